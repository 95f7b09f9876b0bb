"""Performances composed for training, an action a folder."""
