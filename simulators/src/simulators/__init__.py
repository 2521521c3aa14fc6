"""Simulated arms that speak their robots' own protocols, with a task's objects before them."""
