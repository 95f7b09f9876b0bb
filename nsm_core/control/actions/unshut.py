"""Open or shut a front of furniture: walk to where a hand reaches its handle all the way, move it, let go.

The network walks and stands; the hand is led.
"""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.rotations import Array
from nsm_core.world.affordances.pulling import Pulling, plan_pulling
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing

from .approach import Command
from .at_reach import AtReach, where_led
from .base import Grasp, StageStart, Way
from .front_grasp import Pull

SHUT = 0.05  # share of its travel up to which a front counts as shut
_MOVED = 0.01  # share of its travel from which on a front is planned for anew


def planned(goal: Goal, front: Front, solids: DistanceQuery, plan: FloorPlan | None, here: Array) -> Pulling:
    """How the ``front`` of a goal, as it is then, is moved among ``solids``, which are everything but it, by
    who comes from ``here`` (2,).  GoalError where it cannot be.
    """
    known = goal.pulling
    if known is not None and abs(known.begin - front.opening) < _MOVED:
        return known
    held = front.grip(front.opening).held[:2]
    goal.pulling = where_led(
        lambda around: plan_pulling(front, goal.opening, around), solids, plan, here, [held]
    )
    return goal.pulling


class Unshut(AtReach):
    """Go to where the hand works, move the front, let go of it."""

    def __init__(self, goal: Goal, start: StageStart) -> None:
        super().__init__(goal, start.ground)
        front = goal.moves(Front)
        riding = [p for p in start.scene.props if isinstance(p, LightThing) and front.carries(p.pose)]
        solids = start.scene.but(front, *riding)
        self.pulling = planned(goal, front, solids, start.ground.plan, start.moment.root[:2])
        self.grasp: Grasp | None = None
        self._hand = Pull(front, self.pulling, start.scene.props)
        self.go(self.pulling.reach)

    def update(self, moment: Moment) -> Command:
        if self.part == 0 and self.there(moment):
            self.part, self.grasp = 1, self._hand
        if self.part == 1:
            return self.approach.final
        return self.approach.update(moment, self.there)

    def stays_at(self) -> tuple[Array, float] | None:
        return (self.reach.place, self.reach.heading) if self.part == 1 else None

    def arrived(self, moment: Moment) -> bool:
        return self.passed(moment) and not self._hand.active and moment.speed < 0.15

    def passed(self, moment: Moment) -> bool:
        return self.part == 1 and self._hand.left

    def target(self) -> tuple[Array | None, float, int]:
        return np.append(self.pulling.reach.place, 0.0), self.pulling.reach.heading, 2

    def end(self, reached: bool, again: bool = False) -> None:
        if not reached:
            self._hand.let_go()


def is_done(goal: Goal, front: Front) -> bool:
    """Whether a front is open, or shut, as a goal asks for, as far as it would be moved."""
    return abs(front.opening - goal.opening) < 0.5


def places(goal: Goal, way: Way) -> list[Array | None]:
    """To where the front is moved from."""
    front = goal.moves(Front)
    if way.solids is None:
        return []
    front = way.fronts.get(front.name, front)
    if is_done(goal, front):
        return []
    riding = [name for name, pose in way.poses.items() if front.carries(pose)]
    standing = Union(way.standing(front.name, *riding))
    pulling = planned(goal, front, standing, way.plan, way.here)
    way.fronts[front.name] = front.at(pulling.end)
    for name in riding:
        way.poses[name] = front.carried(way.poses[name], pulling.end)
    return [pulling.reach.place]


__all__ = ["SHUT", "Unshut", "is_done", "places", "planned"]
