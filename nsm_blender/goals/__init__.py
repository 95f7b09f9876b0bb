"""From objects, empties and actions of a scene to goals of the core."""
