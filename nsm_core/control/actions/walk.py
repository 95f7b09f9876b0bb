"""Stages that end at a place: walk, run, and to stay where one is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import IDLE, SIT
from nsm_core.distances import STAND_AHEAD
from nsm_core.rotations import Array, heading_to_direction, wrap_angle
from nsm_core.world.scene.props import Prop

from . import follow
from .approach import REACH, RUNNING, WALKING, Approach, Command, Gait, Ground
from .base import EXECUTED, Performer, Stage, StageStart, Way
from .steer import Steer

LED_RUN = 1.0  # metres from its end up to which a run is led, as in the training data
FACED = np.radians(25)  # of the goal's heading within which one is there
LED_WALK = 0.6  # the same of a walk along a line, or at a speed that is asked for


class Stay(Stage):
    """Stand where one is; a sitter rises to stand before the seat."""

    def __init__(self, goal: Goal, moment: Moment, rest: str = "idle", thing: Prop | None = None) -> None:
        """``rest`` is what is commanded, with ``thing`` in the hands."""
        super().__init__(goal)
        seated = float(moment.style[SIT]) > 0.5
        at = moment.root[:2] + (STAND_AHEAD if seated else 0.0) * heading_to_direction(
            np.array(moment.heading)
        )
        place = np.append(at, 0).astype(np.float32)
        self.command = Command(rest, place, float(moment.heading), thing=thing)

    def update(self, moment: Moment) -> Command:
        return self.command

    def arrived(self, moment: Moment) -> bool:
        return float(moment.style[IDLE]) > EXECUTED and moment.speed < 0.15

    def target(self) -> tuple[Array | None, float, int]:
        return None, 0.0, 2


class Go(Stage):
    """Walk or run to a place and stand there."""

    def __init__(
        self,
        goal: Goal,
        ground: Ground,
        reach: float = REACH,
        gait: Gait = WALKING,
        rest: str = "idle",
        thing: Prop | None = None,
        told: Array | None = None,
    ) -> None:
        """``reach``: metres from the place at which it is commanded itself, as ``rest``; ``thing`` is in the
        hands, and ``told`` (3,) where that is to be.
        """
        super().__init__(goal)
        final = Command(rest, goal.position if told is None else told, goal.heading, thing=thing)
        stand = goal.position[:2].astype(np.float64)
        self.approach = Approach(ground, stand, goal.heading, final, reach, gait, thing=thing)

    def pass_on(self, onward: Array) -> None:
        super().pass_on(onward)
        self.approach.through(onward)

    def passed(self, moment: Moment) -> bool:
        return self.approach.passed or self.arrived(moment)

    def update(self, moment: Moment) -> Command:
        return self.approach.update(moment, self.arrived)

    def arrived(self, moment: Moment) -> bool:
        near = float(np.linalg.norm(moment.root[:2] - self.goal.position[:2])) < 0.3
        facing = abs(float(wrap_angle(moment.heading - self.goal.heading))) < FACED
        return near and facing and moment.speed < 0.15


def _goer(gait: Gait, reach: float, led: float) -> Callable[[Goal, StageStart], Stage]:
    """Stages of a gait: along the goal's line or to its place; at the goal's own speed, if it has one.

    ``reach``: metres from which one is sent to the goal itself, and ``led`` the same where the way counts.
    """

    def begin(goal: Goal, start: StageStart) -> Stage:
        if goal.steering is not None:
            return Steer(goal, start.ground, start.moment)
        if goal.way is not None:
            return follow.Follow(goal, start.ground, gait, led)
        if goal.speed is not None:
            return Go(goal, start.ground, led, replace(gait, speeds=(goal.speed, goal.speed)))
        return Go(goal, start.ground, reach, gait)

    return begin


def _places(goal: Goal, way: Way) -> list[Array | None]:
    if goal.steering is not None:
        return []
    return [goal.position[:2].astype(np.float64)] if goal.way is None else follow.places(goal, way)


STAY = Performer(lambda goal, start: Stay(goal, start.moment), lambda goal, way: [])
WALK = Performer(_goer(WALKING, REACH, LED_WALK), _places)
RUN = Performer(_goer(RUNNING, LED_RUN, LED_RUN), _places)
