"""Adapters to compare with that have a name; others are in `rivals`."""
