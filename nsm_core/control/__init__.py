"""What is wanted now: goals, the director that leads to them, and takes."""
