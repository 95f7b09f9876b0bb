"""What belongs to a goal and is done before and after it: fronts that shut its thing away are opened, things
that block it are put aside, and what was opened is shut again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.rotations import Array
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing

from . import unshut
from .approach import Command
from .base import Stage
from .before import Before

_THERE = 0.02  # metres from where it is to be put aside at which a thing is there


class InParts(Before):
    """Do what has to be done first, one thing after the other, what the goal asks for, and what comes then.

    ``stage`` is the goal's own one, by which it is judged; ``_now`` the one at work.
    """

    def __init__(self, goal: Goal, begin: Callable[[Goal, Moment], Stage]) -> None:
        super().__init__(goal)
        own = replace(goal, first=(), then=())
        self._left, self._begin, self._parts = [*goal.first, own, *goal.then], begin, 0
        self._own = own
        self._now: Stage | None = None
        self._aside: list[str] = []
        self._shut: list[Front] = []

    @property
    def at_work(self) -> Stage | None:
        """What is being done now, the goal's own stage or one before or after it."""
        return self._now

    def update(self, moment: Moment) -> Command:
        while self._left and (self._now is None or self._now.passed(moment)):
            self._go_on(self._left.pop(0), moment)
        assert self._now is not None  # the goal's own part is never done beforehand
        return self._now.update(moment)

    def _go_on(self, part: Goal, moment: Moment) -> None:
        """Begin what is next, unless that has been done by now."""
        if part is not self._own and is_done(part):
            return
        if self._now is not None:
            self._now.end(True)
            self._parts += self._now.part + 1
        self._now = self._begin(part, moment)
        if part is self._own:
            self.begin(self._now)
        elif isinstance(part.prop, LightThing):
            self._aside.append(part.name)
        elif isinstance(part.prop, Front) and self.stage is not None:
            self._shut.append(part.prop)

    def passed(self, moment: Moment) -> bool:
        return not self._left and self._now is not None and self._now.passed(moment)

    def arrived(self, moment: Moment) -> bool:
        return not self._left and self._now is not None and self._now.arrived(moment)

    def line(self) -> tuple[Array | None, list[str]]:
        line, remarks = super().line() if self.stage is None else self.stage.line()
        if self._aside:
            were = "was" if len(self._aside) == 1 else "were"
            remarks = [f"{' and '.join(self._aside)} stood in the way and {were} put aside first.", *remarks]
        for front in self._shut:
            far = "" if front.opening < unshut.SHUT else " as far as an arm could"
            remarks = [*remarks, f"{front.name} was shut again{far}."]
        return line, remarks

    def keeps_off(self) -> tuple[FloorPlan, Array] | None:
        return None if self._now is None else self._now.keeps_off()

    @property
    def errors(self) -> dict[str, Any]:
        """Those of the goal's own hands."""
        return {} if self.stage is None else self.stage.errors

    @property
    def part(self) -> int:  # type: ignore[override]
        """Counts on over all that is done."""
        return self._parts + (0 if self._now is None else self._now.part)


def is_done(goal: Goal) -> bool:
    """Whether what belongs to a goal has been done by now."""
    if isinstance(goal.prop, Front):
        return unshut.is_done(goal, goal.prop)
    thing = goal.moves(LightThing)
    return bool(np.linalg.norm(thing.pose[:3] - goal.position) < _THERE)


__all__ = ["InParts"]
