"""Captured frames found, laid end to end and joined without a pop."""
