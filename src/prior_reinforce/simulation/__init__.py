"""Env: the paper's tasks in contact physics, and how a session is run on them."""
