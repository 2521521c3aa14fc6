"""Algorithm 1, trial by trial: sessions, their events, and the state these add up to."""
