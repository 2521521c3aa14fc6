"""Env: dynamic manipulation tasks in contact physics. Each a `.py` with its `.xml`."""
