"""Furniture and doors from meshes, and the pool that they are drawn from."""
