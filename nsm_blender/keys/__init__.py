"""A take becomes keys of actions, and a scene is put back as it was."""
