"""Two furnished rooms by code."""
