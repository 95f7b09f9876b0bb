"""Ways without an object."""
