"""Trials of every action: fixed scenes and starts, and their figures."""
