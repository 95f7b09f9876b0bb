"""Measures of motion, of what hands do with objects, and of the data itself."""
