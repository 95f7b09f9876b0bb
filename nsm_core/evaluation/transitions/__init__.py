"""Transition networks and their rivals on gaps of actors held out (papers/001 section 7)."""
