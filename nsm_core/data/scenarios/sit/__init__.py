"""Seats that are sat down on."""
