"""Doors that are opened and passed."""
