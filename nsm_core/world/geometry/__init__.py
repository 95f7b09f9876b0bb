"""Distances to solids, and meshes made ready to be measured."""
