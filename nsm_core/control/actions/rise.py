"""Leaving a seat that was taken from the side: the body turns back on it before it rises, as what stands
before the seat asks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import SIT
from nsm_core.distances import STAND_AHEAD
from nsm_core.rotations import heading_to_direction, wrap_angle

from .approach import Command
from .base import SeatTarget, Stage
from .before import Before

TURNED, UP, BESIDE = (
    np.radians(12),
    0.3,
    0.2,
)  # from here on one may rise; sit label and metres from where one is up beside the seat
PATIENCE = 75  # frames after which one rises, and after which one goes on, all the same


class TurnBack(Before):
    """Turn on the seat as ``back`` commands, rise to stand beside it, and then do what ``following`` makes of
    the goal.
    """

    def __init__(self, goal: Goal, back: Command, following: Callable[[Moment], Stage]) -> None:
        super().__init__(goal)
        self.back, self.following = back, following
        stand = np.asarray(back.position)[:2] + STAND_AHEAD * heading_to_direction(np.array(back.heading))
        self._stand = np.append(stand, back.heading).astype(np.float32)
        self._rise = Command("idle", np.append(stand, 0.0), back.heading)
        self.command, self._frames = back, 0

    def update(self, moment: Moment) -> Command:
        if self.stage is None:
            self._frames += 1
            if self.command is self.back and (self._turned(moment) or self._frames > PATIENCE):
                self.command, self._frames = self._rise, 0
            elif self.command is self._rise and (self._up(moment) or self._frames > PATIENCE):
                # What follows is planned from where one is about to stand: the way there leads off the seat.
                self.begin(self.following(replace(moment, root=self._stand, heading=self.back.heading)))
        return self.command if self.stage is None else self.stage.update(moment)

    def _turned(self, moment: Moment) -> bool:
        return (
            abs(float(wrap_angle(moment.heading - self.back.heading))) < TURNED
            or float(moment.style[SIT]) < 0.5
        )

    def _up(self, moment: Moment) -> bool:
        return (
            float(moment.style[SIT]) < UP
            and float(np.linalg.norm(moment.root[:2] - self._stand[:2])) < BESIDE
        )

    def seat(self) -> SeatTarget | None:
        if self.stage is not None:
            return self.stage.seat()
        return (np.asarray(self.back.position), None) if self.command is self.back else None

    def leave(self, following: Goal) -> Command | None:
        if self.stage is not None:
            return self.stage.leave(following)
        return self.back if self.command is self.back else None
