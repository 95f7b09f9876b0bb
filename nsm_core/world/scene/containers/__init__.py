"""Containers: furniture whose doors, drawers, slides and lids open on what stands inside."""

from __future__ import annotations

from .container import Container, Shelf
from .moving_part import MovingPart, moving_part

__all__ = ("Shelf", "Container", "MovingPart", "moving_part")
