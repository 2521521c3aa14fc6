"""The evidence: tasks in physics, and the experiments that make the tables and figures."""
