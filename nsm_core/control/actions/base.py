"""What every action is made of: a stage, which commands the network and judges how far it has come."""

from __future__ import annotations

from nsm_core.body.ik.foot_plant import SeatTarget
from nsm_core.control.goals import Goal, Moment
from nsm_core.rotations import Array

from .approach import Command

EXECUTED = 0.9  # a label over this counts as executed (design of the response times)


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

    def seat(self) -> SeatTarget | None:
        """The seat that the hips are to settle on."""
        return None

    def leave(self, following: Goal) -> Command | None:
        """What is commanded before another goal may begin; None where it may begin at once."""
        return None

    def end(self, reached: bool, again: bool = False) -> None:
        """Give way to the next goal; ``again`` tells that it carries the same box."""
