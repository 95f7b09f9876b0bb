"""How one hand takes a light thing and puts it elsewhere: the grasp that serves both places, where one stands
for either, and the ways of the wrist to and from them, past everything that stands there.

Fields by fast marching lead the ways (``planning.hand_way``), as those do that a planner is taught by
(papers/002 section 4).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.hand_fields import HandSpace, hand_space
from nsm_core.world.planning.hand_way import (
    HAND,
    arm_behind,
    filled,
    lacking,
    pushed_off,
    resampled,
    way_into,
)
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.wrist import WristPose, beside_held

from .grasps import OneHandGrasp, find_grasps
from .reach import LEFT, REACHED, RIGHT, Reach, least_strained
from .setting_out import before_body

LOWEST = 0.4  # metres over the floor down to which a body bends for what one hand takes
_LEAST_ROOM = 0.005  # metres that a hand has around it where it takes a thing
_GRASPS, _ALIKE = 8, 2  # of a kind that are tried, and of these by either hand, the best first
_WAYS = 7  # of them for which ways are looked for
_HEADINGS = 12  # in which a thing may be put down
# Balls along each side of a thing whose way is looked at closely, and metres between places of that way.
_FINELY, _APART = 6, 0.01
# Metres that a thing that is put down may be in what stands beside it, and over its board at which one looks.
_STANDS, _RAISED = 0.006, 0.02
# Metres that a way may lack for no other to be looked for, and that a forearm may brush something by.
_TOUCHES, _BRUSH = 0.006, 0.012
_WORTH = 4.0  # strain that a metre of a grasp's score makes up for


@dataclass(frozen=True)
class Visit:
    """A hand at a thing where it stands: the pose of the ``wrist``, world, with the thing on its palm, the
    ``reach`` of the body, and ways (K, 3) there from one place beside or before it: of an ``empty`` hand, and
    ``laden`` with the thing.
    """

    wrist: WristPose
    reach: Reach
    empty: Array
    laden: Array
    lack: float = 0.0  # metres that hand, forearm or thing lack on them to be out of everything


@dataclass(frozen=True)
class Picking:
    """A thing taken from where it is ``at`` (4,) by the ``grasp`` of one ``hand`` (0 right, 1 left), and put
    down at ``pose`` (4,).
    """

    grasp: OneHandGrasp
    hand: int
    pick: Visit
    put: Visit
    at: Array
    pose: Array

    def wrist(self, pose: Array) -> WristPose:
        """The wrist in the world that holds the thing where that has ``pose`` (4,)."""
        return beside_held(self.grasp.at(pose), self.grasp.width, (RIGHT, LEFT)[self.hand])


@dataclass(frozen=True)
class Around:
    """What a picking is planned among, without the thing itself: ``hands`` keep off all of it, ``bodies``
    stand off it, where there is ``room`` (N,), metres, about places (N, 2) on the floor.
    """

    hands: DistanceQuery
    bodies: DistanceQuery
    room: Callable[[Array], Array]


@dataclass(frozen=True)
class Match:
    """How one ``hand`` (0 right, 1 left) could take a thing and put it down at ``pose`` (4,): by which
    ``grasp``, where one stands for either, and how hard that is; ways are not looked for yet.
    """

    cost: float
    grasp: OneHandGrasp
    hand: int
    pick: Reach
    put: Reach
    pose: Array

    def wrist(self, pose: Array) -> WristPose:
        """As ``Picking.wrist``."""
        return beside_held(self.grasp.at(pose), self.grasp.width, (RIGHT, LEFT)[self.hand])


def plan_picking(
    thing: LightThing,
    place: Array,
    around: Around,
    there: Around | None = None,
    hands: Sequence[int] = (0, 1),
) -> Picking:
    """Plan to take a thing from where it is and put it down with its foot at ``place`` (3,), by one of
    ``hands`` (0 right, 1 left); ``there`` is what is around by then, where that is something else.

    Raises GoalError, a sentence on what stands in the way: no grasp that has room, no place to stand, no way
    of the hand.
    """
    there = there or around
    return led(thing, matches(thing, place, around, there, hands), around, there)


def led(thing: LightThing, found: Sequence[Match], around: Around, there: Around) -> Picking:
    """The first of some matches that ways lead a hand to and from out of everything, or that with the least
    in its way; ``around`` the thing, and ``there`` where it is put.  GoalError as of ``plan_picking``.
    """
    first = hand_space(thing, around.hands, thing.middle)
    spaces: dict[float, HandSpace] = {}
    cleared, best, least = False, None, np.inf
    for match in found[:_WAYS]:
        visit = _visit(thing, match.grasp, match.hand, match.pick, first, around)
        if visit is None:
            continue
        cleared = True
        put = thing.put(match.pose)
        turn = float(match.pose[3])
        if turn not in spaces:
            spaces[turn] = hand_space(put, there.hands, put.middle)
        last = _visit(put, match.grasp, match.hand, match.put, spaces[turn], there)
        if last is None:
            continue
        lack = max(visit.lack, last.lack)
        if lack < least:
            best = Picking(match.grasp, match.hand, visit, last, thing.pose.copy(), match.pose)
            least = lack
        if least <= _TOUCHES:
            break
    if best is not None:
        return best
    where = f"the place of {thing.name}" if cleared else thing.name
    raise GoalError(
        f"No way leads a hand to {where} past what stands there; move something away from before it."
    )


def matches(
    thing: LightThing, place: Array, around: Around, there: Around, hands: Sequence[int] = (0, 1)
) -> list[Match]:
    """How each of ``hands`` could take a thing and put it down with its foot at ``place`` (3,), the easiest
    first; see ``plan_picking``, also for the errors.
    """
    grasps = grasps_with_room(thing, around.hands)
    grasps = _mixed(grasps, lambda grasp: grasp.kind, _GRASPS)
    if not grasps:
        raise GoalError(f"A hand has no room to take {thing.name}; move away what stands close to it.")
    picks = sorted(_picks(thing, grasps, around, hands), key=lambda one: one[0])
    picks = _mixed(picks, lambda one: (one[1].kind, one[2]), _ALIKE)
    if not picks:
        raise GoalError(f"{thing.name} is out of reach: {_why(thing.middle[2])}")
    poses = [np.append(place, turn) for turn in np.arange(_HEADINGS) * 2 * np.pi / _HEADINGS]
    poses = [pose for pose in poses if _stands_free(thing, pose, there.hands)]
    if not poses:
        raise GoalError(
            f"The place of {thing.name} is taken by something that stands there; clear it, or choose another."
        )
    found = sorted(_puts(poses, picks, there), key=lambda one: one.cost)
    if not found:
        raise GoalError(
            f"The place of {thing.name} is out of reach of the hand that takes it: "
            f"{_why(place[2] + float(thing.size[2]) / 2)}"
        )
    return found


def grasps_with_room(thing: LightThing, around: DistanceQuery) -> list[OneHandGrasp]:
    """Grasps of a thing where it is, the best first, that a hand has room for among what is ``around`` it.
    Raises GoalError on what is too large or too heavy for one hand.
    """
    return find_grasps(
        thing.name,
        thing.query,
        thing.low,
        thing.high,
        thing.pose,
        around,
        thing.mass,
        thing.handle,
        _LEAST_ROOM,
    )


_Pick = tuple[float, OneHandGrasp, int, Reach]


_One = TypeVar("_One")


def _mixed(found: Sequence[_One], kind: Callable[[_One], object], most: int) -> list[_One]:
    """The first ones of every kind, in their order."""
    seen: Counter[object] = Counter()
    kept = []
    for one in found:
        seen[kind(one)] += 1
        if seen[kind(one)] <= most:
            kept.append(one)
    return kept


def _picks(
    thing: LightThing, grasps: Sequence[OneHandGrasp], around: Around, hands: Sequence[int]
) -> Iterator[_Pick]:
    """Cost, grasp, hand and where one stands, the least strained of either hand."""
    for grasp in grasps:
        for hand in hands:
            side = (RIGHT, LEFT)[hand]
            wrist = beside_held(grasp.at(thing.pose), grasp.width, side)
            found = _standing(wrist, side, around)
            if found is not None:
                yield found.strain - _WORTH * grasp.score, grasp, hand, found


def _stands_free(thing: LightThing, pose: Array, solids: DistanceQuery) -> bool:
    """Whether a thing that stands at ``pose`` (4,) is in nothing beside or over it."""
    balls = filled(thing.put(pose + (0, 0, _RAISED, 0)), _FINELY)
    places, radii = (np.array(column) for column in zip(*balls, strict=True))
    room = solids.signed_distance(places.astype(np.float32), float(radii.max()) + 0.01)
    return bool((room > radii - _STANDS).all())


def _puts(poses: Sequence[Array], picks: Sequence[_Pick], around: Around) -> Iterator[Match]:
    """The same with where one stands to put the thing down, and how it then stands, one of ``poses`` (4,)."""
    for cost, grasp, hand, pick in picks:
        side, best = (RIGHT, LEFT)[hand], None
        for pose in poses:
            found = _standing(beside_held(grasp.at(pose), grasp.width, side), side, around)
            if found is not None and (best is None or found.strain < best[0].strain):
                best = found, pose
        if best is not None:
            yield Match(cost + best[0].strain, grasp, hand, pick, *best)


def _standing(wrist: WristPose, side: float, around: Around) -> Reach | None:
    """The least strained way to stand for a wrist where the floor is free."""
    if not LOWEST <= wrist.held[2] <= REACHED[1]:
        return None
    return least_strained(wrist, around.bodies, side, around.room)


def _visit(
    thing: LightThing, grasp: OneHandGrasp, hand: int, reach: Reach, space: HandSpace, around: Around
) -> Visit | None:
    wrist = beside_held(grasp.at(thing.pose), grasp.width, (RIGHT, LEFT)[hand])
    for begin in before_body(wrist, reach, around.hands, thing):
        empty, laden = (way_into(space, wrist, begin, held, whole=True) for held in (None, thing))
        if empty is not None and laden is not None:
            break
    else:
        return None
    bare = [(np.zeros(3), HAND)]
    held = [(place - wrist.place, radius) for place, radius in filled(thing, _FINELY)]
    empty, laden = (
        pushed_off(resampled(np.concatenate((begin[None], way)), _APART), balls, around.hands)
        for way, balls in ((empty, bare), (laden, held))
    )
    arm = [(place, radius - _BRUSH) for place, radius in arm_behind(wrist)]
    lacks = ((empty, arm), (laden, arm), (laden, held))
    return Visit(wrist, reach, empty, laden, max(lacking(way, balls, around.hands) for way, balls in lacks))


def _why(height: float) -> str:
    low, high = LOWEST, REACHED[1]
    if not low <= height <= high:
        return (
            f"it is {height:.2f} m over the floor, and one hand takes things between {low:.1f} and "
            f"{high:.1f} m; choose another height."
        )
    return "there is no free floor before it within an arm's length; make room to stand there."
