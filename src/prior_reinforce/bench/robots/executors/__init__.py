"""Ways of executing a plan on an arm."""
