"""Fields around a thing that a hand takes or leaves (section 4.1): how far it is, how far obstacles are, and
when a hand arrives.

All three are inverse and clipped, so that they stay continuous at surfaces (equations 3, 4 and 6).  The paper
leaves its three bounds open; ``NEAREST`` and ``SOONEST`` are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.geometry.eikonal import NEVER, arrival_times
from nsm_core.world.scene.wrist import WristPose

SIDE, CELL = 0.8, 0.025  # metres: of the cube, and of its cells
NEAREST, SOONEST = 0.025, 0.2  # metres and seconds under which nothing is told apart
SPREAD = 0.08  # metres from a hand's path at which the front is slower by exp(-1/2): sigma of equation 5
_SLOWEST, _AWAY = 0.1, 1e-3  # metres a second of a hand at least; and of its speed, far from its path
# Metres: what is nearer to a solid than half a cell is closed to a front, so that no board lies between two
# cells.
_SHUT = CELL / 2 + 1e-6
_KNOWN = 2 * CELL  # metres from a surface within which distances are as they are told, not marched
TOLD = 0.25  # metres up to which they are told


@dataclass(frozen=True)
class HandFields:
    """Fields over the cube of ``SIDE`` metres around a thing, each (N, N, N) at the middles ``points``
    (N, N, N, 3), world: ``target`` and ``obstacles``, one over metres (equations 3 and 4), and ``arrival``,
    one over seconds (equation 6).  0 is told of what is not reached.
    """

    points: Array
    target: Array
    obstacles: Array
    arrival: Array


def grid_around(centre: Array, heading: float = 0.0) -> Array:
    """Middles (N, N, N, 3) of the cells of the cube around a point (3,), metres, turned by ``heading``
    radians.
    """
    steps = (np.arange(round(SIDE / CELL)) + 0.5) * CELL - SIDE / 2
    grid: Array = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), -1)
    return rotate_planar(grid, np.float64(heading)) + np.asarray(centre, dtype=np.float64)


@dataclass(frozen=True)
class HandSpace:
    """What of a scene the ways of a hand to one thing have in common, over the cells ``points`` (N, N, N, 3),
    world: metres ``to_target`` and ``to_obstacles`` (N, N, N), told up to ``TOLD``, and the fields
    ``target`` and ``obstacles`` (equations 3 and 4).
    """

    points: Array
    to_target: Array
    to_obstacles: Array
    target: Array
    obstacles: Array

    def along(self, path: Array) -> HandFields:
        """The three fields of a hand that goes along ``path`` (T, 3), 30 Hz, world, to where it holds the
        thing.  To leave is the way there, backwards.  Raises GeometryError on a path of fewer than two
        places, or one that does not come into the cube.
        """
        shut = (self.to_target <= 0) | (self.to_obstacles < _SHUT)
        arrival = _inverse(_arrival(self.points, np.asarray(path, dtype=np.float64), shut), SOONEST)
        return HandFields(self.points, self.target, self.obstacles, arrival)


def hand_space(
    target: DistanceQuery, obstacles: DistanceQuery, centre: Array, heading: float = 0.0
) -> HandSpace:
    """Measure the space around ``centre`` (3,), in cells turned by ``heading`` radians; ``target`` is the
    thing and ``obstacles`` everything else, world.
    """
    points = grid_around(centre, heading)
    to_target, to_obstacles = _distances(target, points), _distances(obstacles, points)
    inside, closed = to_target <= 0, to_obstacles < _SHUT
    return HandSpace(
        points,
        to_target,
        to_obstacles,
        _inverse(_marched(to_target, closed & ~inside), NEAREST),
        _inverse(_marched(to_obstacles, inside), NEAREST),
    )


def hand_fields(target: DistanceQuery, obstacles: DistanceQuery, centre: Array, path: Array) -> HandFields:
    """Compute the three fields around ``centre`` (3,) for one ``path`` (T, 3), as ``HandSpace.along``."""
    return hand_space(target, obstacles, centre).along(path)


def _marched(near: Array, closed: Array) -> Array:
    """Metres (N, N, N) to a surface around what is ``closed`` (equation 2), from distances that are known
    within ``_KNOWN`` of it.
    """
    start = np.where((near < _KNOWN) & ~closed, np.maximum(near, 0.0), np.inf)
    if not np.isfinite(start).any():
        return np.full(near.shape, NEVER)
    return arrival_times(np.where(closed, np.inf, 1.0), start, CELL)


def _arrival(points: Array, path: Array, closed: Array) -> Array:
    """Seconds (N, N, N) that remain to a hand at each point before it holds the thing (equation 5)."""
    if path.ndim != 2 or path.shape[1] != 3 or len(path) < 2:
        raise GeometryError("A hand's way needs two places at least.")
    speed = np.maximum(np.linalg.norm(np.gradient(path, axis=0), axis=1) * FPS, _SLOWEST)
    off, nearest = _from_path(points.reshape(-1, 3), path)
    off, nearest = off.reshape(closed.shape), nearest.reshape(closed.shape)
    rate = speed[nearest] * np.maximum(np.exp(-((off / SPREAD) ** 2) / 2), _AWAY)
    to_end = np.linalg.norm(points - path[-1], axis=-1)
    # A hand comes to rest there: what the path itself says, no quotient of small numbers.
    start = np.where(to_end < CELL, (len(path) - 1 - nearest) / FPS, np.inf)
    if not np.isfinite(start).any():
        raise GeometryError("A hand's way ends outside of the space around what it holds.")
    # Where a hand has been is open, however near it passed.
    slowness = np.where(closed & (off > CELL * 0.87), np.inf, 1 / rate)
    return arrival_times(slowness, start, CELL)


def _from_path(points: Array, path: Array) -> tuple[Array, Array]:
    """Metres (N,) from points (N, 3) to the nearest place of a path (T, 3), and its number (N,)."""
    square = (points**2).sum(1)[:, None] - 2 * points @ path.T + (path**2).sum(1)
    nearest = square.argmin(1)
    return np.sqrt(np.maximum(square[np.arange(len(points)), nearest], 0.0)), nearest


def told_at(values: Array, places: Array) -> Array:
    """Values (N, N, N) over the cells around the origin, at places (P, 3) in their frame: trilinear between
    their middles, those of the edge beyond it.
    """
    at = np.clip((places + SIDE / 2) / CELL - 0.5, 0, len(values) - 1.001)
    low = at.astype(int)
    part = at - low
    out = np.zeros(len(places))
    for corner in np.ndindex(2, 2, 2):
        share = np.prod(np.where(corner, part, 1 - part), axis=1)
        i, j, k = (low + corner).T
        out += share * values[i, j, k]
    return out


def straight_in(wrist: WristPose, length: float = 0.5, seconds: float = 1.0) -> Array:
    """Places (T, 3) at 30 Hz of a wrist that comes straight to a pose over ``length`` metres, as smoothly as
    can be (minimum jerk).
    """
    share = np.linspace(0.0, 1.0, max(round(seconds * FPS), 2) + 1)
    eased = share**3 * (10 - 15 * share + 6 * share**2)
    return wrist.place - (length * (1 - eased))[:, None] * wrist.towards


def _distances(query: DistanceQuery, points: Array) -> Array:
    flat = query.signed_distance(points.reshape(-1, 3).astype(np.float32), TOLD)
    return flat.reshape(points.shape[:-1]).astype(np.float64)


def _inverse(far: Array, least: float) -> Array:
    """One over what is not under ``least``; 0 for what is never reached; float32."""
    return np.where(far < NEVER, 1 / np.maximum(far, least), 0.0).astype(np.float32)
