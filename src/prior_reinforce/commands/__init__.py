"""The command line, one command a class: a frozen dataclass of its flags, and `run`."""
