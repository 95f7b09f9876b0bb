"""What each goal action makes of a goal, an action a file."""
