"""Climb: walk squarely up to a step or a low wall, then onto it or over it."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import CLIMB
from nsm_core.rotations import Array, heading_to_direction, rotate_planar, wrap_angle
from nsm_core.world.scene.terrain import edge_before

from .approach import Approach, Command, Ground
from .base import Performer, Stage, StageStart, Way
from .walk import Go

BEFORE = 0.6  # metres from the near edge of the object to where one stands before it
UNKNOWN = 0.3  # metres from the goal to the edge where the object is not known
NEAR, ASIDE, ASKEW = (
    1.6,
    0.2,
    np.radians(40),
)  # from where on the climb is commanded: along and across the way, and facing it
AWAY_FROM_EDGE = 0.1  # metres in from the sides of what is climbed where one is on it
UPRIGHT = 0.7  # metres that the hips are over the place where one stands


class Climb(Stage):
    """Come to the standing place, or to the line through it, and climb."""

    def __init__(self, goal: Goal, ground: Ground) -> None:
        super().__init__(goal)
        self.ground, self.stand = ground, foot_of(goal)
        final = Command("idle+walk", goal.position, goal.heading, thing=goal.interaction)
        self.approach = Approach(ground, self.stand, goal.heading, final, ready=self._ready)

    def _ready(self, moment: Moment) -> bool:
        """Whether the way ahead leads squarely onto the object."""
        ahead = heading_to_direction(np.array(self.goal.heading))
        way = self.stand - moment.root[:2]
        along, across = float(way @ ahead), abs(float(way @ (-ahead[1], ahead[0])))
        if self._up_there(moment) or float(np.hypot(along, across)) < 0.3 or float(moment.style[CLIMB]) > 0.5:
            return True
        facing = abs(float(wrap_angle(moment.heading - self.goal.heading))) < ASKEW
        return (
            -0.3 < along < NEAR
            and across < ASIDE
            and facing
            and self.ground.free(moment.root[:2].astype(np.float64), self.stand)
        )

    def update(self, moment: Moment) -> Command:
        ahead = heading_to_direction(np.array(self.goal.heading))
        past = self._up_there(moment) or float((moment.root[:2] - self.stand) @ ahead) > BEFORE + 0.15
        if self.approach.given and past:  # from up there no way leads back to the foot
            self.approach.stand = self.goal.position[:2].astype(np.float64)
        return self.approach.update(moment, self.arrived)

    def _up_there(self, moment: Moment) -> bool:
        """Whether one stands on the object already, as high as the goal: one walks on up there, straight."""
        thing, goal = self.goal.interaction, self.goal.position
        if thing is None or float(goal[2]) <= 0 or float(moment.hips[2]) < float(goal[2]) + UPRIGHT:
            return False
        places = rotate_planar(
            np.stack((moment.root[:2], goal[:2])) - thing.centre[:2], np.float64(-thing.heading)
        )
        return bool((np.abs(places) < np.asarray(thing.size[:2]) / 2 - AWAY_FROM_EDGE).all())

    def arrived(self, moment: Moment) -> bool:
        goal = self.goal.position
        near = float(np.linalg.norm(moment.root[:2] - goal[:2])) < 0.3
        return near and moment.speed < 0.15 and float(moment.hips[2]) > float(goal[2]) + UPRIGHT


def foot_of(goal: Goal) -> Array:
    """Where (2,) one stands before the object of a climb."""
    back = (
        UNKNOWN
        if goal.interaction is None
        else edge_before(goal.interaction, goal.position[:2], goal.heading)
    )
    return goal.position[:2].astype(np.float64) - (back + BEFORE) * heading_to_direction(
        np.array(goal.heading)
    )


def _begin(goal: Goal, start: StageStart) -> Stage:
    """Who is sent up a flight of stairs walks there."""
    if start.ground.stairs.lead_to(goal.position):
        return Go(goal, start.ground)
    return Climb(goal, start.ground)


def _places(goal: Goal, way: Way) -> list[Array | None]:
    place = goal.position[:2].astype(np.float64)
    if way.plan is not None and way.plan.stairs.lead_to(goal.position):
        return [place]
    return [foot_of(goal), None, place]


PERFORMER = Performer(_begin, _places)
