"""What a plan is, and how it is coded, timed and kept."""
