"""Pick and place: walk to where one hand takes a light thing, take it out, bring it, put it down, withdraw.

The network walks and stands; the hand goes along ways that are planned past everything that stands there.
"""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.rotations import Array
from nsm_core.world.affordances.picking import Picking, plan_picking
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import LightThing

from .approach import Command, Gait
from .at_reach import AtReach, where_led
from .base import Performer, StageStart, Way
from .thing_grasp import Holding

LADEN = Gait(speeds=(0.85, 1.05))  # of who has a thing in one hand
_MOVED = 0.01  # metres from where it was planned to be taken at which a thing is planned for anew


def planned(
    goal: Goal, solids: DistanceQuery, plan: FloorPlan | None, here: Array, pose: Array | None = None
) -> Picking:
    """How the thing of a goal is taken and put down among ``solids``, which are everything but it, by who
    comes from ``here`` (2,); ``pose`` (4,) where it stands by then.  GoalError where it cannot be.
    """
    thing = goal.moves(LightThing)
    pose = thing.pose if pose is None else pose
    known = goal.picking
    if known is not None and np.linalg.norm(known.at[:3] - pose[:3]) < _MOVED:
        return known
    there, end = thing.put(pose), goal.position.astype(np.float64)

    goal.picking = where_led(
        lambda around: plan_picking(there, end, around), solids, plan, here, (pose[:2], end[:2])
    )
    return goal.picking


class Place(AtReach):
    """Go to the thing, take it, go to its place, put it down."""

    def __init__(self, goal: Goal, start: StageStart) -> None:
        super().__init__(goal, start.ground)
        thing = goal.moves(LightThing)
        solids = start.scene.but(thing)
        self.picking = planned(goal, solids, start.ground.plan, start.moment.root[:2])
        self.grasp: Holding | None = None
        self._hands = Holding(thing, self.picking, solids)
        self.go(self.picking.pick.reach)

    def update(self, moment: Moment) -> Command:
        hands = self._hands
        if self.part == 0 and self.there(moment):
            self.part, self.grasp = 1, hands
        elif self.part == 1 and hands.brought:
            self.part = 2
            self.go(self.picking.put.reach, LADEN, self.goal.prop)
        elif self.part == 2 and self.there(moment):
            self.part = 3
            hands.put_down()
        if self.part in (1, 3):
            return self.approach.final
        return self.approach.update(moment, self.there)

    def stays_at(self) -> tuple[Array, float] | None:
        return (self.reach.place, self.reach.heading) if self.part in (1, 3) else None

    def arrived(self, moment: Moment) -> bool:
        return self.passed(moment) and not self._hands.active and moment.speed < 0.15

    def passed(self, moment: Moment) -> bool:
        return self.part == 3 and self._hands.left

    def target(self) -> tuple[Array | None, float, int]:
        return self.picking.pose[:3], float(self.picking.pose[3]), 3

    def end(self, reached: bool, again: bool = False) -> None:
        if not reached:
            self._hands.let_go()


def _places(goal: Goal, way: Way) -> list[Array | None]:
    """To where the thing is taken, and to where it is put down."""
    thing = goal.moves(LightThing)
    if way.solids is None:
        return []
    pose, picking = way.poses.get(thing.name), goal.picking
    if pose is not None or picking is None:
        picking = planned(goal, Union([way.solids, *way.fronts.values()]), way.plan, way.here, pose)
    way.poses[thing.name] = picking.pose
    return [picking.pick.reach.place, picking.put.reach.place]


PERFORMER = Performer(Place, _places)

__all__ = ["PERFORMER", "Place", "planned"]
