"""One's own arm: recordings, robots and their limits, and the workspace that keeps it all."""
