"""From captures to training data: library, stitching, scenes, annotation, export."""
