"""What belongs to a goal and is done before it: fronts that shut its thing away are opened, things that block
it are put aside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.rotations import Array
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing

from . import unshut
from .approach import Command
from .base import Stage
from .before import Before

_THERE = 0.02  # metres from where it is to be put aside at which a thing is there


class First(Before):
    """Do what has to be done first, one thing after the other, then what the goal asks for."""

    def __init__(self, goal: Goal, begin: Callable[[Goal, Moment], Stage]) -> None:
        super().__init__(goal)
        self._left, self._begin, self._parts = list(goal.first), begin, 0
        self._now: Stage | None = None
        self._aside: list[str] = []

    def update(self, moment: Moment) -> Command:
        while self.stage is None:
            if self._now is not None:
                if not self._now.passed(moment):
                    return self._now.update(moment)
                self._now.end(True)
                self._parts, self._now = self._parts + self._now.part + 1, None
            if not self._left:
                self.begin(self._begin(replace(self.goal, first=()), moment))
            elif not is_done(first := self._left.pop(0)):
                self._now = self._begin(first, moment)
                self._aside += [first.name] if isinstance(first.prop, LightThing) else []
        return self.stage.update(moment)

    def line(self) -> tuple[Array | None, list[str]]:
        line, remarks = super().line() if self.stage is None else self.stage.line()
        if self._aside:
            were = "was" if len(self._aside) == 1 else "were"
            remarks = [f"{' and '.join(self._aside)} stood in the way and {were} put aside first.", *remarks]
        return line, remarks

    def stays_at(self) -> tuple[Array, float] | None:
        now = self.stage or self._now
        return None if now is None else now.stays_at()

    def end(self, reached: bool, again: bool = False) -> None:
        if self._now is not None:
            self._now.end(reached, again)
        super().end(reached, again)

    @property
    def part(self) -> int:  # type: ignore[override]
        """Counts on over all that is done."""
        now = self.stage or self._now
        return self._parts + (0 if now is None else now.part)

    @property
    def grasp(self) -> object:
        """The hand that is at work on what is done first, then those of the stage that follows."""
        return getattr(self.stage or self._now, "grasp", None)

    @property
    def other(self) -> object:
        """The hand that the stage in hand puts to work on a second thing."""
        return getattr(self.stage or self._now, "other", None)

    @property
    def approach(self) -> object:
        """How the stage in hand comes to its place, to be looked for anew."""
        return getattr(self.stage or self._now, "approach", None)


def is_done(goal: Goal) -> bool:
    """Whether what a goal asks to be done first has been done by now."""
    if isinstance(goal.prop, Front):
        return unshut.is_done(goal, goal.prop)
    thing = goal.moves(LightThing)
    return bool(np.linalg.norm(thing.pose[:3] - goal.position) < _THERE)


__all__ = ["First"]
