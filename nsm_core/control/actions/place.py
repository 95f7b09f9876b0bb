"""Pick and place: walk to where one hand takes a light thing, take it out, bring it, put it down, withdraw.

The network walks and stands; the hand goes along ways that are planned past everything that stands there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import SIT
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, wrap_angle
from nsm_core.world.affordances.picking import Around, Picking, plan_picking
from nsm_core.world.affordances.reach import Reach
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.planning.walked_to import walked_to
from nsm_core.world.scene.props import LightThing

from .approach import WALKING, Approach, Command, Gait, Ground
from .base import Performer, Stage, StageStart, Way
from .thing_grasp import Holding

# Metres, radians and m/s within which one has come to stand where a hand works; frames of standing still
# after which further off does, and how much.
NEAR, FACING, SLOW = 0.1, np.radians(14), 0.12
PATIENCE, ALSO_NEAR, ALSO_FACING = 25, 0.3, np.radians(40)
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

    def room(places: Array) -> Array:
        return np.full(len(places), np.inf) if plan is None else np.asarray(plan.clearance(places))

    around = Around(solids, solids, room)
    if plan is not None:
        reached = walked_to(plan, here, np.stack((pose[:2], end[:2])))
        led_to = replace(around, room=lambda places: np.where(reached(places), room(places), -np.inf))
        try:
            goal.picking = plan_picking(there, end, led_to)
            return goal.picking
        except GoalError:
            pass  # a place that cannot be walked to is found all the same: then it is the way that is missing
    goal.picking = plan_picking(there, end, around)
    return goal.picking


class Place(Stage):
    """Go to the thing, take it, go to its place, put it down."""

    def __init__(self, goal: Goal, start: StageStart) -> None:
        super().__init__(goal)
        thing = goal.moves(LightThing)
        self.ground: Ground = start.ground
        solids = start.scene.but(thing)
        self.picking = planned(goal, solids, start.ground.plan, start.moment.root[:2])
        self.grasp: Holding | None = None
        self._hands = Holding(thing, self.picking, solids)
        self._go(self.picking.pick.reach)

    def _go(self, reach: Reach) -> None:
        self._reach, self._still = reach, 0
        final = Command("idle", np.append(reach.place, 0.0).astype(np.float32), reach.heading)
        thing, gait = (self.goal.prop, LADEN) if self.part else (None, WALKING)
        self.approach = Approach(
            self.ground, reach.place, reach.heading, final, gait=gait, thing=thing, anyway=True
        )

    def _there(self, moment: Moment) -> bool:
        """Whether one stands where the hand works, or near it and comes no nearer."""
        if moment.speed > SLOW or float(moment.style[SIT]) > 0.1:
            self._still = 0
            return False
        self._still += 1
        off = float(np.linalg.norm(moment.root[:2] - self._reach.place))
        turned = abs(float(wrap_angle(moment.heading - self._reach.heading)))
        if off < NEAR and turned < FACING:
            return True
        return self._still > PATIENCE and off < ALSO_NEAR and turned < ALSO_FACING

    def update(self, moment: Moment) -> Command:
        hands = self._hands
        if self.part == 0 and self._there(moment):
            self.part, self.grasp = 1, hands
        elif self.part == 1 and hands.brought:
            self.part = 2
            self._go(self.picking.put.reach)
        elif self.part == 2 and self._there(moment):
            self.part = 3
            hands.put_down()
        if self.part in (1, 3):
            return self.approach.final
        return self.approach.update(moment, self._there)

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
    picking = planned(goal, way.solids, way.plan, way.here, way.poses.get(thing.name))
    way.poses[thing.name] = picking.pose
    return [picking.pick.reach.place, picking.put.reach.place]


PERFORMER = Performer(Place, _places)

__all__ = ["PERFORMER", "Place", "planned"]
