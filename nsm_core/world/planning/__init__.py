"""Ways over the floor and of what is carried."""
