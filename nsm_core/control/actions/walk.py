"""Stages that end at a place: walk, run, sit, and to stay where one is."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import STAND_AHEAD, Goal, Moment, Seat
from nsm_core.conventions import IDLE, SIT
from nsm_core.rotations import Array, heading_to_direction, wrap_angle

from .approach import REACH, RUNNING, WALKING, Approach, Command, Ground
from .sit import before_seat

EXECUTED = 0.9  # a label over this counts as executed (design of the response times)
SEATED_WITHIN = 0.2  # metres between hips and goal that still count as seated on it
STILL = np.radians(3)  # a second: who turns faster has not come to rest on the seat
SLOW = 0.3  # m/s below which one who sits down from the side turns


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

    def seat(self) -> Seat | None:
        """The seat that the hips are to settle on."""
        return None

    def leave(self, following: Goal) -> Command | None:
        """What is commanded before another goal may begin; None where it may begin at once."""
        return None

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
    """Walk to where one sits down, before the seat or beside it, and sit; from the side one turns once one is seated."""

    def __init__(self, goal: Goal, ground: Ground, moment: Moment) -> None:
        super().__init__(goal)
        stand, heading = before_seat(goal, ground.plan, moment.root[:2])
        self._side = abs(float(wrap_angle(heading - goal.heading))) > 0.1
        self._seated = self._on_it(moment)  # whether the seat has been reached
        self._there = Command("sit", goal.position, goal.heading, thing=goal.interaction)
        # One who is sent from the side to sit in another direction would walk round to the front, through what stands there.
        self._back = Command("sit", goal.position, heading, thing=goal.interaction) if self._side else self._there
        ready = self._beside if self._side else None
        self.approach = Approach(ground, stand, heading, self._back, ready=ready, anyway=self._side)

    def _beside(self, moment: Moment) -> bool:
        """From the side one is led to the very place: the seat is asked for with the back to it."""
        near = float(np.linalg.norm(moment.root[:2] - self.approach.stand)) < 0.25
        return near and abs(float(wrap_angle(moment.heading - self.approach.heading))) < np.radians(30)

    def update(self, moment: Moment) -> Command:
        if not self._seated:
            command = self.approach.update(moment, self.arrived)
            self._seated = self.approach.given and self._on_it(moment) and moment.speed < SLOW
        return self._there if self._seated else command

    def _on_it(self, moment: Moment) -> bool:
        near = float(np.linalg.norm(moment.hips - self.goal.position)) < SEATED_WITHIN
        return near and float(moment.style[SIT]) > EXECUTED

    def arrived(self, moment: Moment) -> bool:
        turned = not self._side or abs(float(wrap_angle(moment.heading - self.goal.heading))) < np.radians(15)
        return turned and self._on_it(moment) and moment.speed < 0.1 and moment.turning < STILL

    def target(self) -> tuple[Array | None, float, int]:
        return self.goal.position, self.goal.heading, 3

    def seat(self) -> Seat | None:
        return self.goal.position, None if self._side and not self._seated else self.goal.heading

    def leave(self, following: Goal) -> Command | None:
        stays = following.action == "sit" and float(np.linalg.norm(following.position - self.goal.position)) < SEATED_WITHIN
        return self._back if self._side and self._seated and not stays else None
