"""What a standing body reaches with one hand: where it stands for a pose of the wrist, and how low it goes.

The bundled body's measures: it bends its knees and its back for what is low, and stretches for what is high.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import (
    Array,
    direction_to_heading,
    heading_to_direction,
    rotate_planar,
    wrap_angle,
)
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.clearance_map import HEIGHTS
from nsm_core.world.scene.wrist import WristPose

REACHED = (0.2, 2.0)  # heights over the floor at which hands are used, metres
RIGHT, LEFT = -1.0, 1.0  # the side of a hand: of X where a body faces -Y
_SHOULDER, _LOWEST, _ASIDE = 1.44, 0.7, 0.175  # heights of the shoulder upright and squatting; metres aside
_FOREARM, _ARM = 0.255, 0.545  # elbow to wrist, shoulder to wrist, metres
_FOLDED = 0.22  # least way from the shoulder to a wrist that still works
_WRIST = np.radians(75)  # by which the hand points away from the line of the arm at most
_SLIM = 0.17  # metres from the root to a body that stands close to furniture
_TOES = 0.06  # metres by which lower legs may be under the edge of something, and feet in a plinth
_OFFS = np.arange(0.26, 0.86, 0.06)  # metres over the floor from the root to the wrist
_BEARINGS = np.radians(np.arange(-75, 76, 15))  # the wrist's bearing from where the body faces
_PLACES = 16
ROOM, KNEES = (
    0.19,
    0.3,
)  # metres about who stands and reaches, and more by the metre that the body goes down
_AT_ONCE = 16  # places of which it is looked at once whether a body has room there
# Metres that the shoulder goes ahead by leaning over something, what it loses in height for a metre squared,
# and what such a metre strains; how far it is raised for what is high.
LEANS, _SINKS, _STRAINS, _RAISED = (0.0, 0.1, 0.2), 1.0, 1.0, 0.06
_BEFORE, _BESIDE, _HIGH = 0.28, 0.2, 0.95  # metres from the root, and over the floor, of a hand raised
# Places between a body and a wrist at which nothing may stand, the share of the way they are over, and
# metres.
_BETWEEN, _BEFORE_WRIST, _CLEAR = 30, 0.9, 0.01
# Metres aside at which that room should be as well, and what a metre that is lacking there strains.
_ELBOWS, _CROWDS = 0.25, 2.0
# Metres about who stands there from which on more is no better, and what a metre that is lacking strains: who
# stands closer sweeps what stands before him as he turns away.
_AMPLE, _PRESSES = 0.3, 2.0
# Radians off straight ahead within which a wrist is reached for with ease, and what one beyond strains.
_AHEAD, _TWISTS = np.radians(25), 0.5
_LEAN = 0.5  # share of what it goes down by which the shoulder goes ahead as well, metres a metre


@dataclass(frozen=True)
class Reach:
    """A way to reach: ``place`` (2,) and ``heading`` of the root, ``side`` of the hand, ``down`` metres that
    the shoulder is lower than upright, ``strain`` how near it is to what the arm can do, 1, and more where
    the body leans or twists; ``lean`` metres that the shoulder is ahead for that.
    """

    place: Array
    heading: float
    side: float
    down: float
    strain: float
    lean: float


def reaches(wrist: WristPose, solids: DistanceQuery, sides: tuple[float, ...] = (RIGHT, LEFT)) -> list[Reach]:
    """Find where a body stands to bring a wrist to a pose, world: the least strained first, empty where it
    cannot.

    ``solids`` what is in the way of a body that stands there.  Heights outside of ``REACHED`` are out of
    reach.
    """
    found = _strained(wrist, sides)
    return [_reach(row) for row in found[has_room(found[:, :2], solids) & _open(found[:, :2], wrist, solids)]]


def least_strained(
    wrist: WristPose,
    solids: DistanceQuery,
    side: float,
    room: Callable[[Array], Array],
    other: WristPose | None = None,
) -> Reach | None:
    """The first of ``reaches`` about whose place there is ``room`` (N,), metres, of places (N, 2), and more
    for knees where the body goes down; rather where there is room to turn, and for hips and elbows to either
    side, too.  None where there is none.  With ``other``, a pose of the other hand's wrist, from there both
    are reached.
    """
    found = _strained(wrist, (side,), other)
    if len(found):
        about = room(found[:, :2])
        roomy = about > ROOM + KNEES * found[:, 4]
        found = found[roomy]
        aside = _ELBOWS * heading_to_direction(found[:, 2] + np.pi / 2)
        beside = np.minimum(room(found[:, :2] + aside), room(found[:, :2] - aside))
        found[:, 5] += _CROWDS * np.clip(ROOM - beside, 0.0, ROOM)
        # Which place is chosen, not which grasp: a thing at the back of a board is pressed for whatever way.
        pressed = _PRESSES * np.maximum(_AMPLE - about[roomy], 0.0)
        found = found[np.argsort(found[:, 5] + pressed, kind="stable")]
    for first in range(0, len(found), _AT_ONCE):
        some = found[first : first + _AT_ONCE]
        free = np.flatnonzero(
            np.logical_and.reduce(
                [has_room(some[:, :2], solids)]
                + [_open(some[:, :2], one, solids) for one in (wrist, other) if one is not None]
            )
        )
        if len(free):
            return _reach(some[int(free[0])])
    return None


def _reach(row: Array) -> Reach:
    return Reach(row[:2].copy(), *(float(value) for value in row[2:]))


def _strained(wrist: WristPose, sides: tuple[float, ...], other: WristPose | None = None) -> Array:
    """All that an arm can do, whatever stands there, the least strained first: rows (N, 7) of ``Reach``; with
    the ``other`` wrist of the hand of the other side.
    """
    if not REACHED[0] <= wrist.held[2] <= REACHED[1]:
        return np.zeros((0, 7))
    around = np.arange(_PLACES) * 2 * np.pi / _PLACES
    grid = np.stack(np.meshgrid(_OFFS, around, _BEARINGS, sides, LEANS, indexing="ij"), -1).reshape(-1, 5)
    off, facing_wrist, bearing, side, lean = grid.T
    place = wrist.place[:2] - off[:, None] * heading_to_direction(facing_wrist)
    heading = facing_wrist + bearing
    low = None if other is None else max(_down(wrist), _down(other))
    strain, down = strains(wrist, place, heading, side, lean, low)
    strain = strain + _TWISTS * np.maximum(np.abs(bearing) - _AHEAD, 0)
    if other is not None:
        more = strains(other, place, heading, -side, lean, low)[0]
        twisted = np.abs(wrap_angle(direction_to_heading(other.place[:2] - place) - heading))
        strain = np.maximum(strain, more + _TWISTS * np.maximum(twisted - _AHEAD, 0))
    ways = np.flatnonzero(np.isfinite(strain))
    # Of ways that strain alike the one comes first that faces most as the hand points.
    faces, strain = heading_to_direction(heading) @ wrist.towards[:2], np.round(strain, 6)
    ways = ways[np.lexsort((-faces[ways], strain[ways]))]
    rows = np.column_stack((place, heading, side, np.full(len(off), down), strain, lean))
    return rows[ways]


def _down(wrist: WristPose) -> float:
    """Metres that the body goes down for a wrist, until the shoulder is little over it."""
    return float(np.clip(_SHOULDER - 0.25 - wrist.place[2], 0.0, _SHOULDER - _LOWEST))


def strains(
    wrist: WristPose, place: Array, heading: Array, side: Array, lean: Array, down: float | None = None
) -> tuple[Array, float]:
    """How near (N,) a wrist's pose, world, is to what an arm can do from a root at ``place`` (N, 2) that
    faces ``heading`` (N,), with the hand of a ``side`` (N,) and the body leaning by ``lean`` (N,) metres: 1
    where it just can, infinite where it cannot; and the metres that the shoulder goes down for it, ``down``
    where that is given.
    """
    # The body goes down, and with it ahead.
    down = _down(wrist) if down is None else down
    ahead = heading_to_direction(heading)
    left = np.stack((-ahead[:, 1], ahead[:, 0]), -1)
    shoulder = place + _ASIDE * side[:, None] * left + (min(_LEAN * down, 0.3) + lean)[:, None] * ahead
    up = _SHOULDER - down - _SINKS * lean**2 + np.clip(wrist.place[2] - _SHOULDER, 0.0, _RAISED)
    arm = np.concatenate((wrist.place[:2] - shoulder, (wrist.place[2] - up)[:, None]), 1)
    length = np.linalg.norm(arm, axis=1)
    bent = np.arccos(np.clip((arm / length[:, None]) @ wrist.towards, -1, 1))
    elbow = np.linalg.norm(arm - _FOREARM * wrist.towards, axis=1)
    strain = np.maximum(length / _ARM, np.maximum(bent / _WRIST, 1 - (elbow - 0.1) / 0.3) * 0.99)
    strain = strain + _STRAINS * lean
    can = (length <= _ARM) & (length >= _FOLDED) & (bent <= _WRIST)
    return np.where(can, strain, np.inf), down


def raised(reach: Reach, nearer: float = 0.0) -> Array:
    """Where (3,) the wrist is that a body standing so holds before itself, ``nearer`` metres back."""
    ahead = heading_to_direction(np.array(reach.heading))
    aside = rotate_planar(ahead, np.float64(np.pi / 2))
    return np.append(reach.place + (_BEFORE - nearer) * ahead + reach.side * _BESIDE * aside, _HIGH)


def has_room(places: Array, solids: DistanceQuery, more: float = 0.0) -> Array:
    """Whether (N,) a body has room at places (N, 2), and so many metres ``more``."""
    if not len(places):
        return np.zeros(0, bool)
    heights = np.array(HEIGHTS)
    points = np.concatenate(
        (np.repeat(places, len(heights), 0), np.tile(heights, len(places))[:, None]), 1
    ).astype(np.float32)
    room = solids.signed_distance(points, 0.5).reshape(len(places), -1)
    need = np.where(heights < 0.5, _SLIM - _TOES, _SLIM) + more
    return (room >= need).all(1)


def _open(places: Array, wrist: WristPose, solids: DistanceQuery) -> Array:
    """Whether (N,) nothing lies between bodies at places (N, 2) and a wrist at its height: no wall, no back
    of a shelf.
    """
    if not len(places):
        return np.zeros(0, bool)
    share = np.linspace(0.0, _BEFORE_WRIST, _BETWEEN)[:, None]
    body = np.column_stack((places, np.full(len(places), wrist.place[2])))
    line = body[:, None] + share * (wrist.place - body)[:, None]
    far = solids.signed_distance(line.reshape(-1, 3).astype(np.float32), 0.1).reshape(len(places), -1)
    return np.asarray((far > _CLEAR).all(1))
