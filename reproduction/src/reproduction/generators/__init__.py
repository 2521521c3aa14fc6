"""Generators to compare with: the paper's baselines, and a network for several ways."""
