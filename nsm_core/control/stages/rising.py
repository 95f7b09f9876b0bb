"""Leaving a seat that was taken from the side: the body turns back on it before it rises, as what stands before the seat asks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...conventions import SIT
from ...rotations import Array, wrap_angle
from ..goals import Goal, Moment, Seat
from .approach import Command
from .places import Stage

TURNED = np.radians(12)  # from here on one may rise
PATIENCE = 75  # frames after which one rises all the same


class TurnBack(Stage):
    """Turn on the seat as ``back`` commands, and then do what ``following`` makes of the goal."""

    def __init__(self, goal: Goal, back: Command, following: Callable[[Moment], Stage]) -> None:
        super().__init__(goal)
        self.back, self.following = back, following
        self.stage: Stage | None = None
        self._frames = 0

    def update(self, moment: Moment) -> Command:
        self._frames += 1
        turned = abs(float(wrap_angle(moment.heading - self.back.heading))) < TURNED
        if self.stage is None and (turned or self._frames > PATIENCE or float(moment.style[SIT]) < 0.5):
            self.stage = self.following(moment)
        return self.back if self.stage is None else self.stage.update(moment)

    def arrived(self, moment: Moment) -> bool:
        return self.stage is not None and self.stage.arrived(moment)

    def target(self) -> tuple[Array | None, float, int]:
        return super().target() if self.stage is None else self.stage.target()

    def seat(self) -> Seat | None:
        return (np.asarray(self.back.position), None) if self.stage is None else self.stage.seat()

    def leave(self, following: Goal) -> Command | None:
        return self.back if self.stage is None else self.stage.leave(following)

    def end(self, reached: bool, again: bool = False) -> None:
        if self.stage is not None:
            self.stage.end(reached, again)

    @property
    def part(self) -> int:  # type: ignore[override]
        """0 while one turns, then one more than that of the stage that follows."""
        return 0 if self.stage is None else 1 + self.stage.part

    @property
    def grasp(self) -> object:
        """The hands that the stage that follows puts to work."""
        return getattr(self.stage, "grasp", None)
