"""Ways of a wrist through space: the cheapest one past solids, how it is timed, and a wrist that is turned
along one as along another (papers/002 section 4.2).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.rotations import Array, cross, quat_from_axis_angle, quat_to_matrix
from nsm_core.signals import gaussian_smooth
from nsm_core.world.geometry.eikonal import NEVER, arrival_times
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.wrist import WristPose

from .hand_fields import CELL, HandSpace

HAND = 0.045  # metres from the middle of wrist and forearm to their skin, and a little
AMPLE = 0.12  # metres of room from which on a hand goes at its full speed
_CROWDED = 0.06  # share of it where there is none
FROM = 0.33  # metres from its end at which a way begins, or at the edge of what is looked at
STRAIGHT, LIFT = 0.08, 0.04  # metres straight into a grasp, and up before a thing leaves
_STEP = 0.01  # metres between the places of a way that is not timed yet
_SMOOTH = 3.0  # of such places: deviation of what evens a way out
_NEIGHBOURS = np.array([d for d in product((-1, 0, 1), repeat=3) if any(d)])


def way_past(
    space: HandSpace, end: Array, begin: Array, radius: float, around_target: bool, whole: bool = False
) -> Array | None:
    """The quickest way (K, 3), world, of a ball of ``radius`` metres to ``end`` (3,) from where it comes near
    on its way from ``begin`` (3,), slower where there is little room; None where there is none.  Places are
    about a centimetre apart.  ``around_target``: the thing itself is in the way too.  ``whole``: it
    begins where the space does, or at ``begin`` where that is in it.
    """
    points, room = space.points, space.to_obstacles
    if around_target:
        room = np.minimum(room, space.to_target)
    room, near = room - radius, np.linalg.norm(space.points - end, axis=-1)
    rate = np.clip(room / AMPLE, _CROWDED, 1.0)
    start = np.where(near < CELL, near, np.inf)
    times = arrival_times(np.where((room < 0) & (near >= CELL), np.inf, 1 / rate), start, CELL)
    off = np.linalg.norm(points - begin, axis=-1)
    within = whole and off.min() < CELL
    outer = off < 2 * CELL if within else np.full(near.shape, False) if whole else near > FROM
    if not within:
        for axis in range(3):
            np.moveaxis(outer, axis, 0)[[0, -1]] = True
    cost = np.where(outer & (times < NEVER), times + off, NEVER)
    cell = np.array(np.unravel_index(int(cost.argmin()), cost.shape))
    if cost[tuple(cell)] >= NEVER:
        return None
    found = [points[tuple(cell)]]
    while times[tuple(cell)] > 0 and near[tuple(cell)] >= CELL:
        around = cell + _NEIGHBOURS
        around = around[((around >= 0) & (around < len(points))).all(1)]
        # A step over a corner is longer than one along an edge: the steepest, not the lowest.
        drop = (times[tuple(cell)] - times[tuple(around.T)]) / np.linalg.norm(around - cell, axis=1)
        if drop.max() <= 0:
            return None
        cell = around[int(drop.argmax())]
        found.append(points[tuple(cell)])
    way = resampled(np.array([*found, end]), _STEP)
    return np.concatenate((way[:1], gaussian_smooth(way, _SMOOTH)[1:-1], way[-1:]))


def way_into(
    space: HandSpace, wrist: WristPose, begin: Array, held: LightThing | None = None, whole: bool = False
) -> Array | None:
    """The quickest way (K, 3), world, of a hand from where it comes near on its way from ``begin`` (3,)
    straight into a grasp; with what is ``held`` it is wider, and comes to its place from above.  ``whole`` as
    in ``way_past``.  None where there is none.
    """
    radius, end = HAND, wrist.place - STRAIGHT * wrist.towards
    if held is not None:
        radius = max(HAND, 0.5 * float(np.sort(held.size)[1]))
        end = wrist.place - 0.25 * STRAIGHT * wrist.towards + (0, 0, LIFT)
    way = way_past(space, end, begin, radius, held is None, whole)
    return None if way is None else np.concatenate((way, wrist.place[None]))


def resampled(way: Array, step: float) -> Array:
    """The same way (K, 3) with places about ``step`` metres apart."""
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))))
    count = max(round(along[-1] / step), 2)
    wanted = np.linspace(0, along[-1], count + 1)
    return np.stack([np.interp(wanted, along, column) for column in way.T], -1)


def timed(way: Array, fastest: float) -> Array:
    """Places (T, 3) at 30 Hz of a hand that goes a way (K, 3) from rest to rest, ``fastest`` m/s at most, as
    smoothly as can be (minimum jerk).
    """
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))))
    count = max(round(1.875 * along[-1] / fastest * FPS), 2)
    share = np.linspace(0, 1, count + 1)
    wanted = along[-1] * share**3 * (10 - 15 * share + 6 * share**2)
    return np.stack([np.interp(wanted, along, column) for column in way.T], -1)


def paced(way: Array, fastest: float, frames: int) -> Array:
    """Places (T, 3) at 30 Hz of a hand along a way (K, 3) whose corners are rounded, ``fastest`` m/s at most
    and in no fewer than so many ``frames``.
    """
    way = resampled(way, _STEP)
    way = np.concatenate((way[:1], gaussian_smooth(way, _SMOOTH)[1:-1], way[-1:]))
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    return timed(way, min(fastest, 1.875 * length * FPS / frames))


def turned_along(way: Array, like: Array, rotations: Array) -> Array:
    """Rotations (T, 3, 3) of a wrist along a ``way`` (T, 3) as they are along another, ``like`` (M, 3), whose
    are ``rotations`` (M, 3, 3); both end together (equation 12).

    The smallest turn that takes the one way's direction to the other's, frame by frame from the end on, is
    put onto the wrist whole: columns that are turned by themselves, as the paper writes it, are no rotation.
    """
    ahead, theirs = _directions(way), _directions(like)
    out = np.empty((len(way), 3, 3))
    for back in range(1, len(way) + 1):
        k = min(back, len(like))
        axis = cross(theirs[-k], ahead[-back])
        sine, cosine = float(np.linalg.norm(axis)), float(theirs[-k] @ ahead[-back])
        turn = np.eye(3)
        if sine > 1e-9:
            turn = quat_to_matrix(quat_from_axis_angle(axis / sine, np.arctan2(sine, cosine)))
        out[-back] = turn @ rotations[-k]
    return out


def _directions(way: Array) -> Array:
    """Unit directions (T, 3) along a way; where it rests, those beside."""
    steps = gaussian_smooth(np.gradient(way, axis=0), 2.0)
    return np.asarray(steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-9))
