"""Ways of a wrist through space: the cheapest one past solids, how it is timed, and a wrist that is turned
along one as along another (papers/002 section 4.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.rotations import Array, cross, quat_from_axis_angle, quat_to_matrix
from nsm_core.signals import gaussian_smooth
from nsm_core.world.geometry.distance import DistanceQuery
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
_CORNERS = 1.0  # of such places: deviation of what rounds corners of a way as it is gone
_ROUNDS, _SPARE = 36, 0.03  # in which a way is rounded, and metres of room down to which that may take it
_ARM, _ARM_RADIUS = (0.1, 0.2), 0.042  # metres behind the wrist of balls that stand for a forearm
# Metres that a way is pushed off solids, at most in a round, the rounds; metres at which it is asked which
# way room grows; places by which a push is evened out.
_OFF, _PUSHED, _PUSHES, _PROBE, _EVENLY = 0.012, 0.008, 12, 0.004, 2.0
_PALM, _PALM_RADIUS = 0.08, 0.03  # and before it, of a hand
Ball = tuple[Array, float]  # a place (3,) from the wrist, and a radius, metres
_NEIGHBOURS = np.array([d for d in product((-1, 0, 1), repeat=3) if any(d)])


def way_past(
    space: HandSpace,
    end: Array,
    begin: Array,
    radius: float,
    around_target: bool,
    whole: bool = False,
    firm: Sequence[Ball] = (),
    soft: Sequence[Ball] = (),
) -> Array | None:
    """The quickest way (K, 3), world, of a ball of ``radius`` metres to ``end`` (3,) from where it comes near
    on its way from ``begin`` (3,), slower where there is little room; None where there is none.  Places are
    about a centimetre apart.  ``around_target``: the thing itself is in the way too.  ``whole``: it
    begins where the space does, or at ``begin`` where that is in it.  Balls that go along with it are kept
    off obstacles as well: those that are ``firm`` whatever it takes, as exactly as cells tell, ``soft`` ones
    where there is another way.
    """
    points, room = space.points, space.to_obstacles
    if around_target:
        room = np.minimum(room, space.to_target)
    room, near = room - radius, np.linalg.norm(space.points - end, axis=-1)
    for ball in firm:
        room = np.minimum(room, _beside(space, ball) + CELL / 2)
    shut = (room < 0) & (near >= CELL)
    for ball in soft:
        room = np.minimum(room, _beside(space, ball))
    rate = np.clip(room / AMPLE, _CROWDED, 1.0)
    start = np.where(near < CELL, near, np.inf)
    times = arrival_times(np.where(shut, np.inf, 1 / rate), start, CELL)
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
    return _rounded(space, resampled(np.array([*found, end]), _STEP), room)


def way_into(
    space: HandSpace, wrist: WristPose, begin: Array, held: LightThing | None = None, whole: bool = False
) -> Array | None:
    """The quickest way (K, 3), world, of a hand from where it comes near on its way from ``begin`` (3,)
    straight into a grasp, its forearm behind it; with what is ``held``, where that will stand, it comes to
    its place from above.  ``whole`` as in ``way_past``.  None where there is none.
    """
    soft = arm_behind(wrist)
    soft.append((_PALM * wrist.towards, _PALM_RADIUS))
    firm: list[Ball] = []
    if held is not None:
        firm = [(place - wrist.place, radius) for place, radius in filled(held)]
    end = entry(wrist, held is not None)
    way = way_past(space, end, begin, HAND, held is None, whole, firm, soft)
    return None if way is None else np.concatenate((way, wrist.place[None]))


def pushed_off(way: Array, balls: Sequence[Ball], solids: DistanceQuery) -> Array:
    """A way (K, 3) of ``balls``, places from it and radii, that was found on cells, pushed off ``solids`` as
    exactly as they tell; its ends stay, and less room is asked for near its last one, where a thing stands.
    """
    way, offs, radii = way.copy(), np.array([b[0] for b in balls]), np.array([b[1] for b in balls])
    left = np.linalg.norm(way - way[-1], axis=1)
    wish = _OFF * np.minimum(left / STRAIGHT, 1.0)
    reach = float(radii.max()) + 2 * _OFF

    def room(points: Array) -> Array:
        told = solids.signed_distance(points.reshape(-1, 3).astype(np.float32), reach)
        return np.asarray(told, dtype=np.float64).reshape(points.shape[:-1])

    for _ in range(_PUSHES):
        lack = wish[:, None] + radii - room(way[:, None] + offs)
        worst = lack.argmax(1)
        lack = lack[np.arange(len(way)), worst]
        lack[[0, -1]] = 0.0
        deep = np.flatnonzero(lack > 0)
        if not len(deep):
            break
        at = (way[deep] + offs[worst[deep]])[:, None]
        steep = room(at + _PROBE * np.eye(3)) - room(at - _PROBE * np.eye(3))
        size = np.linalg.norm(steep, axis=1, keepdims=True)
        step = np.zeros_like(way)
        step[deep] = np.minimum(lack[deep], _PUSHED)[:, None] * steep / np.maximum(size, 1e-6)
        step = gaussian_smooth(step, _EVENLY) * np.minimum(np.arange(len(way))[::-1, None], 1.0)
        step[0] = 0.0
        way += step
    return way


def arm_behind(wrist: WristPose) -> list[Ball]:
    """Balls that stand for the forearm behind a wrist."""
    return [(-far * wrist.towards, _ARM_RADIUS) for far in _ARM]


def lacking(way: Array, balls: Sequence[Ball], solids: DistanceQuery) -> float:
    """Metres that ``balls``, places from a way (K, 3) and radii, lack on it at most to be out of solids."""
    offs, radii = np.array([b[0] for b in balls]), np.array([b[1] for b in balls])
    places = (way[:, None] + offs).reshape(-1, 3).astype(np.float32)
    room = solids.signed_distance(places, float(radii.max())).reshape(len(way), -1)
    return float((radii - room).max())


def filled(held: LightThing, most: int = 3) -> list[Ball]:
    """Balls as thick as a thing that fill its box to the corners, where it stands; at most so many along its
    width, depth and height.
    """
    middle, half = (held.low + held.high) / 2, (held.high - held.low) / 2
    radius = float(half.min())
    counts = [min(most, 1 + 2 * int(np.ceil(over / (2 * radius)))) for over in half - radius]
    ends = [np.linspace(-over, over, n) for over, n in zip(half - radius, counts, strict=True)]
    inside = np.stack(np.meshgrid(*ends, indexing="ij"), -1).reshape(-1, 3)
    return [(place, radius) for place in held.to_world(middle + inside)]


def _beside(space: HandSpace, ball: Ball) -> Array:
    """Room (N, N, N) of a ball, metres, that goes along with what is at the cells; told at the edge of what
    lies beyond it.
    """
    return _told(space, space.to_obstacles, space.points + ball[0]) - ball[1]


def _told(space: HandSpace, field: Array, places: Array) -> Array:
    """A field (N, N, N) between its cells, at places (..., 3)."""
    points, last = space.points, len(space.points) - 1
    axes = np.stack([points[1, 0, 0], points[0, 1, 0], points[0, 0, 1]]) - points[0, 0, 0]
    at = np.clip((places - points[0, 0, 0]) @ axes.T / CELL**2, 0, last - 1e-6)
    cell = at.astype(int)
    share = at - cell
    parts = 1 - share, share
    steps = np.array((field.shape[1] * field.shape[2], field.shape[2], 1))
    flat, first = np.ravel(field), cell @ steps
    out = np.zeros(at.shape[:-1])
    for i, j, k in product((0, 1), repeat=3):
        weight = parts[i][..., 0] * parts[j][..., 1] * parts[k][..., 2]
        out += weight * flat[first + np.dot((i, j, k), steps)]
    return out


def _rounded(space: HandSpace, way: Array, room: Array) -> Array:
    """A way (K, 3) evened out between its ends, as far as that leaves ``room`` (N, N, N)."""
    own = _told(space, room, way)
    for _ in range(_ROUNDS):
        even = way.copy()
        even[1:-1] = 0.5 * way[1:-1] + 0.25 * (way[:-2] + way[2:])
        new = _told(space, room, even)
        good = new >= np.minimum(own, _SPARE)
        way, own = np.where(good[:, None], even, way), np.where(good, new, own)
    return way


def entry(wrist: WristPose, laden: bool) -> Array:
    """Where (3,) a hand's way straight into a grasp begins; with a thing in it, it comes from above."""
    if laden:
        return np.asarray(wrist.place - 0.25 * STRAIGHT * wrist.towards + (0, 0, LIFT))
    return np.asarray(wrist.place - STRAIGHT * wrist.towards)


def radius_of(held: LightThing | None) -> float:
    """Metres around a wrist that are to be free on its way, with a thing in the hand or None."""
    return HAND if held is None else max(HAND, 0.5 * float(np.sort(held.size)[1]))


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
    way = np.concatenate((way[:1], gaussian_smooth(way, _CORNERS)[1:-1], way[-1:]))
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
