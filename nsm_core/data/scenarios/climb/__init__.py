"""Steps that are climbed and low walls that are stepped over."""
