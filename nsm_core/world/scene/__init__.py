"""What stands in a scene: props that move, furniture, doors and the ground."""
