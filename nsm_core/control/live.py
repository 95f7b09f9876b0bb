"""A take that is made live: steered, handed over to a goal and taken back at any moment (section 4.1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, direction_to_heading

from .goals import Goal, Steering
from .take import TakeRequest, TakeRunner

_FOR_EVER = 1e9  # seconds that a goal is held until one steers again


class LiveTake:
    """One character that is steered frame by frame: ``runner`` holds what was recorded, ``steering`` what is
    wanted now.

    ``performs`` is the goal that it does by itself, None while it is steered.
    """

    def __init__(self, model: Model, request: TakeRequest) -> None:
        """Begin where ``request`` begins; its goals are not done.  GoalError as of ``TakeRunner``."""
        self.steering = Steering()
        self.performs: Goal | None = None
        self._name = "Keyboard"
        here = Goal("walk", self._name, np.append(request.start_position[:2], 0.0), request.start_heading)
        self._steered = replace(here, steering=self.steering)
        self.runner = TakeRunner(model, replace(request, goals=[self._steered]))

    @property
    def heading(self) -> float:
        """Where the character faces now, radians."""
        return float(self.runner.state.root[0, 2])

    def heading_to(self, place: Array) -> float:
        """The heading in which a place (2,) or (3,) lies from here."""
        return float(direction_to_heading(np.asarray(place)[:2] - self.runner.state.root[0, :2]))

    def hand_over(self, goal: Goal) -> None:
        """Have the character do ``goal`` from the next frame on, and stay at it until it is steered again.

        GoalError, and nothing changes, where it cannot be reached from here.
        """
        self.runner.interrupt([replace(goal, hold=_FOR_EVER), self._steered])
        self.performs = goal

    def take_back(self) -> None:
        """Steer from the next frame on; nothing where one steers."""
        if self.performs is not None:
            self.runner.interrupt([self._steered])
            self.performs = None

    def step(self) -> None:
        """Make one frame; GoalError where the motion breaks down."""
        self.runner.step()
        if self.performs is not None and self.runner.director.goals[self.runner.director.index].steering:
            self.performs = None  # it was given up

    def stop(self) -> None:
        """End here: what was recorded is what there is."""
        self.runner.director.stop()


__all__ = ["LiveTake"]
