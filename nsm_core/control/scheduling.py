"""Which of several things to bring is taken when, and by which hand: one after the other, or two at once, one
in either hand (papers/002 section 6.3).

Poses of the key joints are matched for every thing and either hand; of all orders, and of all ways to go two
by two, the one is performed whose poses lie nearest to each other (equation 24).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product
from typing import NamedTuple, TypeVar

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.affordances.picking import Around, Match, Picking, led, matches, plan_picking
from nsm_core.world.affordances.two_handed import put_at_once, taken_at_once
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing

from .actions.at_reach import where_led
from .actions.base import Way
from .actions.carried import hands_apart
from .actions.registry import PERFORMERS, check_reachable
from .goals import Both, Goal
from .key_poses import KeyPose, cost, standing_at

AT_ONCE = 4  # goals that are ordered together at most
GAIN = 1.5  # metres of equation 24 that another order than the asked one has to save
_Found = TypeVar("_Found")
_TRIED = 4  # plans of two at once for which ways of hands are looked for


@dataclass(frozen=True)
class Schedule:
    """Goals as they are performed, and the ``asked`` number of each."""

    goals: list[Goal]
    asked: list[int]


class _Block(NamedTuple):
    """Numbers of one goal, or of two whose things are carried at once, as they are ``put`` down; the same as
    they are ``taken``, and the hand (0 right, 1 left) that takes each, of one by itself none in particular;
    whether two are taken, and put down, ``at_once``.
    """

    put: tuple[int, ...]
    taken: tuple[int, ...]
    hands: tuple[int, ...] = ()
    at_once: tuple[bool, bool] = (False, False)


def scheduled(goals: Sequence[Goal], plan: FloorPlan, root: Array, solids: DistanceQuery | None) -> Schedule:
    """The goals of a take in the best order for who begins at ``root`` (3,); ``solids`` are what stands
    still.  Goals that cannot be ordered stay where they are.
    """
    found, asked, here = list[Goal](), list[int](), np.asarray(root, dtype=np.float64)
    for run in _runs(goals):
        part, order = [goals[k] for k in run], run
        if len(run) > 1 and solids is not None:
            try:
                part, numbers = _Run(part, goals, plan, here, solids).best()
                order = [run[k] for k in numbers]
            except GoalError:
                pass  # who performs it as it was asked tells what cannot be
        found += part
        asked += order
        here = _left_at(part[-1], here)
    return Schedule(found, asked)


def _left_at(goal: Goal, here: Array) -> Array:
    """The root (3,) of who comes from another one, ``here`` (3,), once a goal is done."""
    last = goal.parts[-1]
    if last.pulling is not None:
        return standing_at(last.pulling.reach)
    if last.picking is not None:
        return standing_at(last.picking.put.reach)
    return np.append(last.position[:2], here[2])


def _runs(goals: Sequence[Goal]) -> Iterator[list[int]]:
    """Numbers of goals that can be ordered among each other, and of others by themselves."""
    run: list[int] = []
    for k, goal in enumerate(goals):
        names = [goals[j].moves(LightThing).name for j in run]
        joins = _orderly(goal) and goal.moves(LightThing).name not in names and len(run) < AT_ONCE
        if run and not joins:
            yield run
            run = []
        if _orderly(goal):
            run.append(k)
        else:
            yield [k]
    if run:
        yield run


def _orderly(goal: Goal) -> bool:
    """Whether a goal brings a thing at no particular time, with nothing to be put aside for it."""
    if not BY_KEY[goal.action].pairs:
        return False
    return goal.by is None and goal.wait == 0 and all(isinstance(one.prop, Front) for one in goal.first)


class _Run:
    """Goals that are ordered, as what they bring stands once all that shuts it away is open."""

    def __init__(
        self, goals: list[Goal], every: Sequence[Goal], plan: FloorPlan, root: Array, solids: DistanceQuery
    ) -> None:
        self.goals, self.plan, self.root = goals, plan, root
        self.things = [goal.moves(LightThing) for goal in goals]
        props = {one.prop.name: one.prop for g in every for one in g.parts if one.prop is not None}
        light = [prop for prop in props.values() if isinstance(prop, LightThing)]
        fronts = {prop.name: prop for prop in props.values() if isinstance(prop, Front)}
        way = Way(root[:2], plan, {t.name: t.pose for t in light}, solids, fronts, light)
        self._still = Union([solids, *(t for t in light if t not in self.things)])
        for one in (one for goal in goals for one in goal.first):
            PERFORMERS[one.action].places(one, way)
        self._around = Union(way.standing(*(thing.name for thing in self.things)))
        self.starts = [way.poses[thing.name] for thing in self.things]
        turns = [0.0 if goal.picking is None else float(goal.picking.pose[3]) for goal in goals]
        self.ends = [
            np.append(g.position.astype(np.float64), turn) for g, turn in zip(goals, turns, strict=True)
        ]
        self._pairs: dict[Hashable, tuple[Match, Match] | None] = {}
        self._matches = [self._matched(k) for k in range(len(goals))]

    def best(self) -> tuple[list[Goal], list[int]]:
        """The goals as they are performed, and the number of each."""
        as_asked = [_Block((k,), (k,)) for k in range(len(self.goals))]
        most = self._cost(as_asked) - GAIN
        plans = [(self._cost(blocks), number, blocks) for number, blocks in enumerate(self._plans())]
        for worth, _, blocks in sorted(plans, key=lambda one: one[:2])[:_TRIED]:
            if worth >= most:
                break
            try:
                return self._performed(blocks), [k for block in blocks for k in block.put]
            except GoalError:
                continue
        return self.goals, list(range(len(self.goals)))

    def _led(self, k: int, find: Callable[[LightThing, Array, Around, Around], _Found]) -> _Found:
        """What is found of a thing among the others where they are to be taken, and where they are put."""
        thing, end = self.things[k].put(self.starts[k]), self.ends[k][:3]
        others = [j for j in range(len(self.things)) if j != k]
        before, by_then = (
            Union([self._around, *(self.things[j].put(poses[j]) for j in others)])
            for poses in (self.starts, self.ends)
        )
        return where_led(
            lambda around: find(thing, end, around, replace(around, hands=by_then, bodies=by_then)),
            before,
            self.plan,
            self.root[:2],
            (self.starts[k][:2], end[:2]),
        )

    def _matched(self, k: int) -> dict[int, list[Match]]:
        """By the hands that can, the ways to bring a thing, the easiest first."""
        found: dict[int, list[Match]] = {}
        for match in self._led(k, matches):
            found.setdefault(match.hand, []).append(match)
        return found

    def _pair(self, block: _Block) -> tuple[Match, Match] | None:
        """How two things are brought at once, in the order in which they are taken; None where they cannot
        be."""
        if not any(block.at_once):
            one, other = (self._matches[k][hand][0] for k, hand in zip(block.taken, block.hands, strict=True))
            return one, other
        key = block.taken, block.hands, block.at_once
        if key not in self._pairs:
            self._pairs[key] = where_led(
                lambda around: self._paired(block, around),
                self._around,
                self.plan,
                self.root[:2],
                [poses[k][:2] for k in block.taken for poses in (self.starts, self.ends)],
            )
        return self._pairs[key]

    def _paired(self, block: _Block, around: Around) -> tuple[Match, Match] | None:
        one, other = (self._matches[k][hand] for k, hand in zip(block.taken, block.hands, strict=True))
        pair: tuple[Match, Match] | None = one[0], other[0]
        if block.at_once[0]:
            a, b = block.taken
            pair = taken_at_once(one, other, (self.starts[a], self.starts[b]), around)
        if block.at_once[1] and pair is not None:
            a, b = block.taken
            pair = put_at_once(*pair, (self.ends[a], self.ends[b]), around)
        return pair

    def _plans(self) -> Iterator[list[_Block]]:
        """All ways to go one by one and two by two, in all orders; in the asked one where anything is opened,
        which a later goal may count on.
        """
        numbers = range(len(self.goals))
        orders = [tuple(numbers)] if any(goal.first for goal in self.goals) else permutations(numbers)
        for order in orders:
            for sizes in product((1, 2), repeat=len(order)):
                ends = np.cumsum(sizes).tolist()
                if len(order) not in ends:
                    continue
                parts = [order[end - size : end] for end, size in zip(ends, sizes, strict=True)]
                yield from map(list, product(*(self._blocks(p) for p in parts[: ends.index(len(order)) + 1])))

    def _blocks(self, part: tuple[int, ...]) -> list[_Block]:
        if len(part) == 1:
            return [_Block(part, part)]
        both, either = (part, part[::-1]), (False, True)
        blocks = [
            _Block(put, taken, hands, once)
            for once, hands in product(product(either, either), ((0, 1), (1, 0)))
            for put, taken in product(both, both)
            # At the same moment there is no order.
            if not (once[0] and taken != part) and not (once[1] and put != part)
            if all(hand in self._matches[k] for k, hand in zip(taken, hands, strict=True))
        ]
        return [block for block in blocks if self._pair(block)]

    def _cost(self, blocks: Sequence[_Block]) -> float:
        poses: list[KeyPose] = []
        for block in blocks:
            pair = self._pair(block) if block.hands else None
            found = dict(zip(block.taken, pair or [self._easiest(k) for k in block.taken], strict=True))
            opens = [one.pulling for k in block.put for one in self.goals[k].first]
            poses += [KeyPose.of(standing_at(o.reach), {}, set()) for o in opens if o is not None]
            carried: set[int] = set()
            for part in [block.taken] if block.at_once[0] else [(k,) for k in block.taken]:
                works = {found[k].hand: found[k].wrist(self.starts[k]) for k in part}
                poses.append(KeyPose.of(standing_at(found[part[0]].pick), works, carried))
                carried = carried | set(works)
            for part in [block.put] if block.at_once[1] else [(k,) for k in block.put]:
                works = {found[k].hand: found[k].wrist(found[k].pose) for k in part}
                carried = carried - set(works)
                poses.append(KeyPose.of(standing_at(found[part[0]].put), works, carried))
            closes = [one.pulling for k in block.put for one in self.goals[k].then]
            poses += [KeyPose.of(standing_at(c.reach), {}, set()) for c in closes if c is not None]
        return cost(KeyPose.of(self.root, {}, set()), poses)

    def _easiest(self, k: int) -> Match:
        known, found = self.goals[k].picking, self._matches[k]
        if known is not None and known.hand in found:
            return found[known.hand][0]
        return min((each[0] for each in found.values()), key=lambda match: match.cost)

    def _performed(self, blocks: Sequence[_Block]) -> list[Goal]:
        """The goals of a plan, with ways of hands; GoalError where there are none."""
        order = [k for block in blocks for k in block.put]
        same, found = order == sorted(order), list[Goal]()
        for block in blocks:
            if not block.hands:
                goal = self.goals[block.put[0]]
                found.append(goal if same else replace(goal, picking=None))
                continue
            pickings = self._pickings(block, same and block.put == block.taken)
            by = dict(zip(block.taken, pickings, strict=True))
            one, other = (self.things[k] for k in block.taken)
            both = Both((one, other), pickings, self.things[block.put[0]].name, block.at_once)
            leads, follows = (self.goals[k] for k in block.put)
            # All is opened before and shut after both, and one does not stand about with a thing in hand.
            opens = tuple(one for k in sorted(block.put) for one in self.goals[k].first)
            shuts = tuple(one for k in sorted(block.put) for one in self.goals[k].then)
            leads = replace(leads, picking=by[block.put[0]], first=opens, then=(), hold=0.0, both=both)
            hold = max(self.goals[k].hold for k in block.put)
            follows = replace(follows, picking=by[block.put[1]], first=(), then=shuts, hold=hold, both=both)
            found += [leads, follows]
        check_reachable(found, self.plan, self.root[:2], self._still)
        return found

    def _pickings(self, block: _Block, known: bool) -> tuple[Picking, Picking]:
        """How two things are taken and put down, as they are taken; as is ``known`` where that serves."""
        pair = self._pair(block)
        if any(block.at_once) and pair is not None:
            one, other = (
                self._led(k, lambda thing, _, *around, match=match: led(thing, [match], *around))
                for k, match in zip(block.taken, pair, strict=True)
            )
            ways = [(one.pick, other.pick)] * block.at_once[0] + [(one.put, other.put)] * block.at_once[1]
            if not all(hands_apart(*visits) for visits in ways):
                raise GoalError("Hands would meet on their ways; bring one thing after the other.")
            return one, other
        one, other = (self._picking(k, h, known) for k, h in zip(block.taken, block.hands, strict=True))
        return one, other

    def _picking(self, k: int, hand: int, known: bool) -> Picking:
        own = self.goals[k].picking
        if known and own is not None and own.hand == hand:
            return own
        return self._led(k, partial(plan_picking, hands=(hand,)))


__all__ = ["Schedule", "scheduled"]
