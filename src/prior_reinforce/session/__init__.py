"""Algorithm 1, trial by trial: what is asked, what is told, and what is known of both."""
