"""Stages that end at a place: walk, run, sit, and to stay where one is."""

from __future__ import annotations

import numpy as np

from ...conventions import IDLE, SIT
from ...rotations import Array, heading_to_direction, wrap_angle
from ..goals import STAND_AHEAD, Goal, Moment
from .approach import REACH, RUNNING, WALKING, Approach, Command, Ground
from .seats import before_seat

EXECUTED = 0.9  # a label over this counts as executed (design of the response times)
SEATED_WITHIN = 0.2  # metres between hips and goal that still count as seated on it


class Stage:
    """One goal while it is performed: what is commanded, and whether it is done."""

    part = 0  # counts the parts of a stage; each has its own time limit

    def __init__(self, goal: Goal) -> None:
        self.goal = goal

    def update(self, moment: Moment) -> Command:
        """Look at the character and return what is commanded; GoalError where no way leads on."""
        raise NotImplementedError

    def arrived(self, moment: Moment) -> bool:
        """Whether the goal is reached now."""
        raise NotImplementedError

    def target(self) -> tuple[Array | None, float, int]:
        """Place (None: any) and heading that the hips, or the box, should have in the end, and over how many axes that counts."""
        return self.goal.position, self.goal.heading, 2

    def end(self, reached: bool, again: bool = False) -> None:
        """Give way to the next goal; ``again`` tells that it carries the same box."""


class Stay(Stage):
    """Stand where one is; a sitter rises to stand before the seat."""

    def __init__(self, goal: Goal, moment: Moment) -> None:
        super().__init__(goal)
        seated = float(moment.style[SIT]) > 0.5
        at = moment.root[:2] + (STAND_AHEAD if seated else 0.0) * heading_to_direction(np.array(moment.heading))
        self.command = Command("idle", np.append(at, 0).astype(np.float32), float(moment.heading))

    def update(self, moment: Moment) -> Command:
        return self.command

    def arrived(self, moment: Moment) -> bool:
        return float(moment.style[IDLE]) > EXECUTED and moment.speed < 0.15

    def target(self) -> tuple[Array | None, float, int]:
        return None, 0.0, 2


class Go(Stage):
    """Walk or run to a place and stand there."""

    def __init__(self, goal: Goal, ground: Ground) -> None:
        super().__init__(goal)
        final = Command("idle", goal.position, goal.heading)
        runs = goal.action == "run"
        # A run is led to its end, as in the training data.
        reach, gait = (1.0, RUNNING) if runs else (REACH, WALKING)
        self.approach = Approach(ground, goal.position[:2].astype(np.float64), goal.heading, final, reach, gait)

    def update(self, moment: Moment) -> Command:
        return self.approach.update(moment, self.arrived)

    def arrived(self, moment: Moment) -> bool:
        return float(np.linalg.norm(moment.root[:2] - self.goal.position[:2])) < 0.3 and moment.speed < 0.15


class Sit(Stage):
    """Walk to where one sits down, before the seat or beside it, and sit."""

    def __init__(self, goal: Goal, ground: Ground, moment: Moment) -> None:
        super().__init__(goal)
        final = Command("sit", goal.position, goal.heading, thing=goal.interaction)
        stand, heading = before_seat(goal, ground.plan, moment.root[:2])
        self._side = abs(float(wrap_angle(heading - goal.heading))) > 0.1
        ready = self._beside if self._side else None
        self.approach = Approach(ground, stand, heading, final, ready=ready, anyway=self._side)

    def _beside(self, moment: Moment) -> bool:
        """From the side one is led to the very place: the seat is asked for with the back to it."""
        near = float(np.linalg.norm(moment.root[:2] - self.approach.stand)) < 0.25
        return near and abs(float(wrap_angle(moment.heading - self.approach.heading))) < np.radians(30)

    def update(self, moment: Moment) -> Command:
        return self.approach.update(moment, self.arrived)

    def arrived(self, moment: Moment) -> bool:
        near = float(np.linalg.norm(moment.hips - self.goal.position)) < SEATED_WITHIN
        turned = not self._side or abs(float(wrap_angle(moment.heading - self.goal.heading))) < np.radians(15)
        return near and turned and float(moment.style[SIT]) > EXECUTED and moment.speed < 0.1

    def target(self) -> tuple[Array | None, float, int]:
        return self.goal.position, self.goal.heading, 3
