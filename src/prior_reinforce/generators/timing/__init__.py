"""When to move, apart from how: demonstrations aligned in time, and generators that learn both."""
