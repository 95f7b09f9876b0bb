"""Captured interactions with other objects: contact transfer and what is swapped by it."""
