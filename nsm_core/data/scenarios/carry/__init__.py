"""Boxes that are picked up, carried and set down."""
