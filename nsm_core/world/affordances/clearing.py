"""What blocks a light thing, and where that is put meanwhile (papers/002 section 6: objects in the way are
moved aside first).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Union
from nsm_core.world.scene.props import LightThing

from .picking import LOWEST, Around, Picking, plan_picking
from .reach import REACHED
from .resting import resting_places

NEIGHBOUR = 0.4  # metres over the floor from a thing within which another one may block it
_LEVEL = 0.35  # metres by which it is higher or lower at most
_SUSPECTS, _AT_ONCE = 5, 2  # neighbours that are tried, and how many of them together at most
_ASIDE = 1.6  # metres from where a thing stood within which a place aside is sought
_PLACES = 8  # aside that are tried, the nearest first
_HEIGHT_COSTS = 1.5  # metres over the floor that a metre higher or lower is worth

Without = Callable[[Sequence[LightThing]], Around]


@dataclass(frozen=True)
class Clearing:
    """Things that are put ``aside`` first, in this order, each with how; then how the thing itself is taken
    and put down, ``picking``.
    """

    aside: list[tuple[LightThing, Picking]]
    picking: Picking


def plan_clearing(
    thing: LightThing, place: Array, others: Sequence[LightThing], without: Without, refused: GoalError
) -> Clearing:
    """Plan to move away as few neighbours as let a hand take a ``thing`` and put it at ``place`` (3,).

    ``others`` the light things that may be moved; ``without`` tells what is around where some are gone.
    Raises ``refused``, why the thing could not be taken as it stands, where nothing that may be moved helps.
    """
    for gone in _suspected(thing, others):
        try:
            plan_picking(thing, place, without([thing, *gone]))
        except GoalError:
            continue
        found = _put_aside(thing, place, gone, without)
        if found is not None:
            return found
    raise refused


def _suspected(thing: LightThing, others: Sequence[LightThing]) -> Iterator[tuple[LightThing, ...]]:
    """Neighbours by themselves and together, the nearest first."""
    off = [one.middle - thing.middle for one in others]
    near = [
        (float(np.linalg.norm(o[:2])), k)
        for k, o in enumerate(off)
        if np.linalg.norm(o[:2]) < NEIGHBOUR and abs(o[2]) < _LEVEL
    ]
    chosen = [others[k] for _, k in sorted(near)[:_SUSPECTS]]
    for count in range(1, _AT_ONCE + 1):
        yield from combinations(chosen, count)


def _put_aside(
    thing: LightThing, place: Array, gone: Sequence[LightThing], without: Without
) -> Clearing | None:
    """How each of ``gone`` is put where it is in nobody's way; None where there is no such place.

    The foremost first: the one that a hand gets at while the others still stand.
    """
    left, aside = list(gone), list[tuple[LightThing, Picking]]()
    moved: list[LightThing] = []
    while left:
        for one in left:
            picking = _aside(one, thing, place, [o for o in left if o is not one], moved, without)
            if picking is not None:
                left = [o for o in left if o is not one]
                aside.append((one, picking))
                moved.append(one.put(picking.pose))
                break
        else:
            return None
    try:
        last = plan_picking(thing, place, _with(without([thing, *gone]), moved))
    except GoalError:
        return None
    return Clearing(aside, last)


def _aside(
    one: LightThing,
    thing: LightThing,
    place: Array,
    waiting: Sequence[LightThing],
    moved: Sequence[LightThing],
    without: Without,
) -> Picking | None:
    """How ``one`` is taken and put where the thing can still be taken, and put down at its ``place``."""
    gone = [one, *waiting, *moved]
    there = _with(without([one, *moved]), [*moved, thing.put(np.append(place, thing.pose[3]))])
    clear = _with(without([thing, *gone]), moved)
    found = resting_places(one, there.hands, one.pose[:3], _ASIDE, LOWEST)
    found = found[found[:, 2] + one.size[2] < REACHED[1]]
    off = found - one.pose[:3]
    cost = np.linalg.norm(off[:, :2], axis=1) + _HEIGHT_COSTS * np.abs(off[:, 2])
    tried: list[Array] = []
    for k in np.argsort(cost, kind="stable"):
        if any(np.linalg.norm(found[k] - other) < 0.12 for other in tried):
            continue
        if len(tried) == _PLACES:
            break
        tried.append(found[k])
        pose = np.append(found[k], one.pose[3])
        try:
            plan_picking(thing, place, _with(clear, [one.put(pose)]))
            return plan_picking(one, found[k], _with(without([one, *moved]), moved))
        except GoalError:
            continue
    return None


def _with(around: Around, things: Sequence[LightThing]) -> Around:
    """The same where some things stand as well."""
    if not things:
        return around
    return replace(around, hands=Union([around.hands, *things]), bodies=Union([around.bodies, *things]))


__all__ = ["NEIGHBOUR", "Clearing", "plan_clearing"]
