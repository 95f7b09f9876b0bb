"""What is around a body: geometry, sensors, furniture and doors, ways over the floor, places to act at."""
