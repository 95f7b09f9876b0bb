"""Weights files, and networks stepped in numpy or torch."""
