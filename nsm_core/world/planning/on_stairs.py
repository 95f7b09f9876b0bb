"""How much room a body has on flights of stairs and their landings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.scene.stairs import Stairs

if TYPE_CHECKING:
    from nsm_core.world.geometry.distance import DistanceQuery

# Metres over the floor that rises: of a body on a flight, over the treads before it, and on a landing, as far
# over that as it is wide.
_OVER_TREADS, _OVER_LANDINGS = (0.75, 1.05, 1.35, 1.65), (0.47, 0.75, 1.05, 1.35, 1.65)
_RAISED = 0.05  # metres from which on a landing lies over the floor
_DROP = 0.12  # metres down at the edge of a landing, which are not walked
_RINGS, _WAYS = (0.08, 0.16, 0.24, 0.32, 0.4), 16  # metres, and directions, in which an edge is looked for


def room_on_stairs(stairs: Stairs, query: DistanceQuery, points: Array, far: float) -> Array:
    """Clearance (N,) of a body at floor points (N, 2), metres, at most ``far``; NaN where no stairs are."""
    out = np.full(len(points), np.nan)
    level = stairs.level(points)
    flight, heights = stairs.on(points), stairs.heights(points)
    landing = ~flight & (level > _RAISED)
    for mask, over in ((flight, _OVER_TREADS), (landing, _OVER_LANDINGS)):
        if mask.any():
            out[mask] = _look(query, points[mask], level[mask], over, far)
    for each in stairs.flights:
        on = flight & each.holds(points, 0.0)
        out[on] = np.minimum(out[on], each.width / 2 - np.abs(each.local(points[on])[:, 1]))
    if landing.any():
        out[landing] = np.minimum(out[landing], _to_edge(stairs, points[landing], heights[landing], far))
    return out


def _look(query: DistanceQuery, points: Array, level: Array, over: tuple[float, ...], far: float) -> Array:
    at = np.concatenate([np.column_stack((points, level + z)) for z in over]).astype(np.float32)
    return np.asarray(query.signed_distance(at, far), dtype=np.float64).reshape(len(over), -1).min(0)


def _to_edge(stairs: Stairs, points: Array, heights: Array, far: float) -> Array:
    """Metres (N,) from points (N, 2) of landings at ``heights`` (N,) to where they fall off."""
    angles = 2 * np.pi * np.arange(_WAYS) / _WAYS
    ways = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    out = np.full(len(points), far)
    for ring in reversed(_RINGS):
        around = (points[:, None] + ring * ways).reshape(-1, 2)
        falls = stairs.heights(around) < np.repeat(heights, _WAYS) - _DROP
        falls &= ~stairs.on(around)
        out[falls.reshape(len(points), _WAYS).any(1)] = ring - _RINGS[0]
    return out


__all__ = ["room_on_stairs"]
