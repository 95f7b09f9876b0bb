"""The armature that is moved: its bones, what carries it, and the bundled character."""
