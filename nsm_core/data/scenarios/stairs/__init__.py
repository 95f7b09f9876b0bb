"""Flights of stairs that are walked up and down."""
