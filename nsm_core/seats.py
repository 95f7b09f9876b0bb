"""Where a person sits on a piece of furniture."""

from __future__ import annotations

from dataclasses import dataclass

from .rotations import Array

# How far behind the front edge of a seat the hips go, and what they keep free of the back, metres.
HIP_BEHIND_EDGE = 0.28
HIP_FROM_BACK = 0.15


@dataclass
class Seat:
    """A place to sit.

    ``point`` (3,) on the seat surface where the hips go, metres, object frame; ``heading`` the way a sitter faces,
    radians (0 faces -Y of the object); ``height`` of the surface over the floor, ``width`` and ``depth`` of the seat
    in metres; ``back`` and ``arms`` tell whether there is something to lean on.
    """

    point: Array
    heading: float
    height: float
    width: float
    depth: float
    back: bool = False
    arms: bool = False


def hip_setback(depth: float) -> float:
    """How far behind the front edge the hips go on a seat of ``depth`` metres, metres."""
    return min(HIP_BEHIND_EDGE, max(depth - HIP_FROM_BACK, depth / 2))
