"""Which of several things to bring is taken when, and by which hand: one after the other, or two at once, one
in either hand (papers/002 section 6.3).

Poses of the key joints are matched for every thing and either hand; of all orders, and of all ways to go two
by two, the one is performed whose poses lie nearest to each other (equation 24).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product
from typing import TypeVar

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.affordances.picking import Around, Match, Picking, matches, plan_picking
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing

from .actions.at_reach import where_led
from .actions.base import Way
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


_Block = tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]
"""Numbers of one goal, or of two whose things are carried at once, as they are put down; the same as they are
taken; and the hand (0 right, 1 left) that takes each of these, of one by itself none in particular."""


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
        last = part[-1]
        here = np.append(last.position[:2], here[2]) if last.picking is None else _put_at(last.picking)
    return Schedule(found, asked)


def _put_at(picking: Picking) -> Array:
    return standing_at(picking.put.reach)


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
    if goal.action != "place" or not isinstance(goal.prop, LightThing):
        return False
    return goal.by is None and goal.wait == 0 and all(isinstance(one.prop, Front) for one in goal.first)


class _Run:
    """Goals that are ordered, as what they bring stands once all that shuts it away is open."""

    def __init__(
        self, goals: list[Goal], every: Sequence[Goal], plan: FloorPlan, root: Array, solids: DistanceQuery
    ) -> None:
        self.goals, self.plan, self.root = goals, plan, root
        self.things = [goal.moves(LightThing) for goal in goals]
        props = {one.prop.name: one.prop for g in every for one in (*g.first, g) if one.prop is not None}
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
        self._matches = [self._matched(k) for k in range(len(goals))]

    def best(self) -> tuple[list[Goal], list[int]]:
        """The goals as they are performed, and the number of each."""
        as_asked = [((k,), (k,), ()) for k in range(len(self.goals))]
        most = self._cost(as_asked) - GAIN
        plans = [(self._cost(blocks), number, blocks) for number, blocks in enumerate(self._plans())]
        for worth, _, blocks in sorted(plans, key=lambda one: one[:2])[:_TRIED]:
            if worth >= most:
                break
            try:
                return self._performed(blocks), [k for put, _, _ in blocks for k in put]
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

    def _matched(self, k: int) -> dict[int, Match]:
        """By the hands that can, the easiest way to bring a thing."""
        found: dict[int, Match] = {}
        for match in self._led(k, matches):
            found.setdefault(match.hand, match)
        return found

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
            return [(part, part, ())]
        both = (part, part[::-1])
        return [
            (put, taken, hands)
            for put, taken, hands in product(both, both, ((0, 1), (1, 0)))
            if all(hand in self._matches[k] for k, hand in zip(taken, hands, strict=True))
        ]

    def _cost(self, blocks: Sequence[_Block]) -> float:
        poses: list[KeyPose] = []
        for put, taken, hands in blocks:
            by = dict(zip(taken, hands, strict=False))
            found = {k: self._matches[k][by[k]] if by else self._easiest(k) for k in put}
            opens = [one.pulling for k in put for one in self.goals[k].first]
            poses += [KeyPose.of(standing_at(o.reach), {}, set()) for o in opens if o is not None]
            carried: set[int] = set()
            for k in taken:
                match = found[k]
                works = {match.hand: match.wrist(self.starts[k])}
                poses.append(KeyPose.of(standing_at(match.pick), works, carried))
                carried = carried | {match.hand}
            for k in put:
                match = found[k]
                carried = carried - {match.hand}
                works = {match.hand: match.wrist(match.pose)}
                poses.append(KeyPose.of(standing_at(match.put), works, carried))
        return cost(KeyPose.of(self.root, {}, set()), poses)

    def _easiest(self, k: int) -> Match:
        known = self.goals[k].picking
        found = self._matches[k]
        if known is not None and known.hand in found:
            return found[known.hand]
        return min(found.values(), key=lambda match: match.cost)

    def _performed(self, blocks: Sequence[_Block]) -> list[Goal]:
        """The goals of a plan, with ways of hands; GoalError where there are none."""
        order = [k for put, _, _ in blocks for k in put]
        same, found = order == sorted(order), list[Goal]()
        for put, taken, hands in blocks:
            if len(put) == 1:
                goal = self.goals[put[0]]
                found.append(goal if same else replace(goal, picking=None))
                continue
            pickings = [
                self._picking(k, hand, same and put == taken) for k, hand in zip(taken, hands, strict=True)
            ]
            leads, follows = (self.goals[k] for k in put)
            by = dict(zip(taken, pickings, strict=True))
            first, second = (self.things[k] for k in taken)
            both = Both((first, second), (pickings[0], pickings[1]), self.things[put[0]].name)
            opens = tuple(one for k in sorted(put) for one in self.goals[k].first)
            # One does not stand about with a thing in hand.
            found.append(replace(leads, picking=by[put[0]], both=both, first=opens, hold=0.0))
            hold = max(leads.hold, follows.hold)
            found.append(replace(follows, picking=by[put[1]], both=both, first=(), hold=hold))
        check_reachable(found, self.plan, self.root[:2], self._still)
        return found

    def _picking(self, k: int, hand: int, known: bool) -> Picking:
        """How a hand takes a thing and puts it down; as is ``known`` where it is for that hand."""
        own = self.goals[k].picking
        if known and own is not None and own.hand == hand:
            return own
        return self._led(k, partial(plan_picking, hands=(hand,)))


__all__ = ["Schedule", "scheduled"]
