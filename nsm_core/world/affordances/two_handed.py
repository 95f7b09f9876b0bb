"""Where one stands to take two things at the same moment, one with either hand, and to put them down so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from nsm_core.rotations import Array, direction_to_heading, heading_to_direction, rotate_planar
from nsm_core.world.scene.wrist import WristPose

from .picking import Around, Match
from .reach import LEFT, RIGHT, Reach, least_strained

_GRASPS = 3  # of either thing that are tried together, the easiest
_FACINGS = 12  # ways to face in which two things are put down
_APART = 0.14  # metres, to the side, between hands that work at the same moment
# Metres over the floor and in height between them, beyond which a body that bends for one is off the other.
_WITHIN, _LEVEL = 0.7, 0.2
_INWARD = np.radians(10)  # by which hands point to each other there

Pair = tuple[Match, Match]
Poses = tuple[Array, Array]


def taken_at_once(one: Sequence[Match], other: Sequence[Match], starts: Poses, around: Around) -> Pair | None:
    """Of matches for two things that stand at ``starts``, each by a hand of its own, the two that are taken
    with most ease from one place; None where there is none.
    """
    best, least = None, np.inf
    for a, b in product(one[:_GRASPS], other[:_GRASPS]):
        reach = _both(a, b, starts, around)
        if reach is not None and reach.strain + a.cost + b.cost < least:
            best, least = (
                (replace(a, pick=reach), replace(b, pick=_beside(reach))),
                reach.strain + a.cost + b.cost,
            )
    return best


def put_at_once(one: Match, other: Match, places: Poses, around: Around) -> Pair | None:
    """Two matches with things that are put down at ``places`` (3,) with most ease from one place, turned as
    one then stands; None where there is none.
    """
    best, least = None, np.inf
    for facing in np.arange(_FACINGS) * 2 * np.pi / _FACINGS:
        a, b = (
            replace(match, pose=np.append(place[:3], _turn(match, facing)))
            for match, place in zip((one, other), places, strict=True)
        )
        reach = _both(a, b, (a.pose, b.pose), around)
        if reach is not None and reach.strain < least:
            best, least = (replace(a, put=reach), replace(b, put=_beside(reach))), reach.strain
    return best


def _beside(reach: Reach) -> Reach:
    """The same of the other hand."""
    return replace(reach, side=-reach.side)


def _both(one: Match, other: Match, poses: Poses, around: Around) -> Reach | None:
    """How one stands to have both things in hand at ``poses`` (4,)."""
    wrists = one.wrist(poses[0]), other.wrist(poses[1])
    off = wrists[1].place - wrists[0].place
    if np.linalg.norm(off[:2]) > _WITHIN or abs(off[2]) > _LEVEL:
        return None
    reach = least_strained(wrists[0], around.bodies, (RIGHT, LEFT)[one.hand], around.room, wrists[1])
    if reach is None:
        return None
    left = rotate_planar(heading_to_direction(np.array(reach.heading)), np.float64(np.pi / 2))
    aside = off[:2] @ left * (1 if one.hand == 0 else -1)
    return reach if aside > _APART else None


def _turn(match: Match, facing: float) -> float:
    """The heading of a thing whose hand points as a body of a ``facing`` does, a little inward."""
    own: WristPose = match.grasp.wrist
    points = own.towards if abs(own.towards[2]) < 0.8 else own.rotation[:, 2]
    side = (RIGHT, LEFT)[match.hand]
    return float(facing - side * _INWARD - direction_to_heading(points[:2]))


__all__ = ["put_at_once", "taken_at_once"]
