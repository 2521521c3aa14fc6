"""Simulated arms that speak their robot's protocol, for its own client library to drive."""
