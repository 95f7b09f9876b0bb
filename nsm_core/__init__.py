"""Neural State Machine core: everything of the product that needs no Blender."""

__version__ = "0.1.0"
