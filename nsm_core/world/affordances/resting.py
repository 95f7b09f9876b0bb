"""Where a light thing may stand among solids: places that bear its foot, with room about and over it."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import LightThing

FREE = 0.05  # metres about a thing that a hand, which puts it down, leaves free
_OVER = 0.08  # metres over a thing for a hand that holds it
_GRID = 0.1  # metres between columns that are looked down
_FROM = (0.15, 1.3)  # heights from which one looks down, metres: over the thing's foot, and over the floor
_NEAR = 0.003  # metres to a surface that count as on it
_STEPS = 24  # towards a surface at most
_EVEN = 0.006  # metres by which what bears a foot is uneven at most
_TOLD = 0.5  # metres up to which distances are asked for


def resting_places(
    thing: LightThing, solids: DistanceQuery, around: Array, within: float, lowest: float
) -> Array:
    """Places (N, 3), world, metres, for the foot of a thing, at most ``within`` metres over the floor from
    the point ``around`` (3,) and ``lowest`` over it; none (0, 3) where nothing bears it or it has no room.

    ``solids`` are everything but the thing.  Surfaces are met from above, ray by ray.
    """
    steps = np.arange(-within, within + 1e-9, _GRID)
    columns = np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2)
    columns = columns[np.linalg.norm(columns, axis=1) <= within] + np.asarray(around)[:2]
    eyes = sorted({float(around[2]) + _FROM[0], _FROM[1]})
    met = np.concatenate([_below(np.column_stack((columns, np.full(len(columns), z))), solids) for z in eyes])
    met = met[np.isfinite(met[:, 2]) & (met[:, 2] >= lowest)]
    if not len(met):
        return np.zeros((0, 3))
    _, kept = np.unique(np.round(met / (_GRID, _GRID, 0.02)), axis=0, return_index=True)
    met = met[np.sort(kept)]
    half = float(np.linalg.norm(thing.size[:2])) / 2
    met = met[_roomy(met, half, float(thing.size[2]), solids)]
    return met[_borne(met, half, solids)] if len(met) else met


def _below(points: Array, solids: DistanceQuery) -> Array:
    """Where (N, 3) surfaces are met below points (N, 3); nan where none is or a point is in something."""
    at = points.copy()
    going = np.ones(len(at), bool)
    found = np.full(len(at), np.nan)
    for _ in range(_STEPS):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        off = solids.signed_distance(at[rows].astype(np.float32), _TOLD).astype(np.float64)
        hit = np.abs(off) < _NEAR
        found[rows[hit]] = at[rows[hit], 2] - off[hit]
        going[rows[hit | (off <= -_NEAR)]] = False
        at[rows, 2] -= np.maximum(off, 0.0)
        going &= at[:, 2] > 0.0
    return np.column_stack((at[:, :2], found))


def _roomy(places: Array, half: float, high: float, solids: DistanceQuery) -> Array:
    """Whether (N,) a thing of radius ``half`` and height ``high`` has room at places (N, 3)."""
    up = np.append(np.arange(0.03, high + _OVER, 0.03), high + _OVER)
    points = np.repeat(places, len(up), 0)
    points[:, 2] += np.tile(up, len(places))
    room = solids.signed_distance(points.astype(np.float32), _TOLD).reshape(len(places), -1)
    return np.asarray((room > np.minimum(half + FREE, up - 0.01)).all(1))


def _borne(places: Array, half: float, solids: DistanceQuery) -> Array:
    """Whether (N,) level ground bears a foot of radius ``half`` all around at places (N, 3)."""
    turn = np.arange(8) * np.pi / 4
    rim = np.column_stack((half * np.cos(turn), half * np.sin(turn), np.full(8, _EVEN)))
    points = (places[:, None] + rim).reshape(-1, 3)
    off = solids.signed_distance(points.astype(np.float32), _TOLD).reshape(len(places), -1)
    return np.asarray(((off > 0) & (off < 2 * _EVEN)).all(1))


__all__ = ["FREE", "resting_places"]
