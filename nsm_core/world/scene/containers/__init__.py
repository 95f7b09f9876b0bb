"""Containers: furniture whose doors, drawers, slides and lids open on what stands inside."""

from __future__ import annotations

from .container import Container, Shelf
from .front import Front
from .moving_part import MovingPart, moving_part

__all__ = ("Shelf", "Container", "Front", "MovingPart", "moving_part")
