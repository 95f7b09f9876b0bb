"""What is done before a goal's own stage may begin: turning back on a seat, setting down what is in hand."""

from __future__ import annotations

from nsm_core.control.goals import Moment
from nsm_core.rotations import Array

from .base import SeatTarget, Stage
from .seat_manner import SeatedManner


class Before(Stage):
    """Something that is done first; ``stage`` is what then performs the goal, None until it begins."""

    stage: Stage | None = None
    _onward: Array | None = None

    @property
    def at_work(self) -> Stage | None:
        """The stage in hand."""
        return self.stage

    def begin(self, stage: Stage) -> None:
        """Have ``stage`` perform the goal from now on."""
        self.stage = stage
        if self._onward is not None:
            stage.pass_on(self._onward)

    def pass_on(self, onward: Array) -> None:
        super().pass_on(onward)
        self._onward = onward
        if self.stage is not None:
            self.stage.pass_on(onward)

    def passed(self, moment: Moment) -> bool:
        return self.stage is not None and self.stage.passed(moment)

    def arrived(self, moment: Moment) -> bool:
        return self.stage is not None and self.stage.arrived(moment)

    def target(self) -> tuple[Array | None, float, int]:
        return super().target() if self.stage is None else self.stage.target()

    def seat(self) -> SeatTarget | None:
        return None if self.stage is None else self.stage.seat()

    def stays_at(self) -> tuple[Array, float] | None:
        return None if self.at_work is None else self.at_work.stays_at()

    def end(self, reached: bool, again: bool = False) -> None:
        if self.at_work is not None:
            self.at_work.end(reached, again)

    @property
    def manner(self) -> SeatedManner | None:  # type: ignore[override]
        """In which the stage that follows takes its seat."""
        return None if self.stage is None else self.stage.manner

    @property
    def part(self) -> int:  # type: ignore[override]
        """0 at first, then one more than that of the stage that follows."""
        return 0 if self.stage is None else 1 + self.stage.part

    @property
    def grasp(self) -> object:
        """The hands that the stage in hand puts to work."""
        return getattr(self.at_work, "grasp", None)

    @property
    def other(self) -> object:
        """The hand that the stage in hand puts to work on a second thing."""
        return getattr(self.at_work, "other", None)

    @property
    def approach(self) -> object:
        """How the stage in hand comes to its place, to be looked for anew."""
        return getattr(self.at_work, "approach", None)


__all__ = ["Before"]
