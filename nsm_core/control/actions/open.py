"""Open: walk to the handle, take it, swing the leaf, pass through; fronts of furniture are ``unshut``."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.distances import OPENED
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.affordances.passage import Passage, passage
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import Leaf

from . import unshut
from .approach import REACH, Approach, Command, Ground
from .base import Performer, Stage, StageStart, Way
from .door_grasp import Opening

HANDLE = 2.5  # metres from which the handle itself is commanded
# A leaf half open that turns by less than this a frame, before a body that stands, is let go after so many
# frames.
STILL, STUCK = np.radians(0.3), 30
SHORT = np.radians(
    8
)  # a leaf let go that has come to within this of what lets one pass is moved on by who passes
AGAIN = 2  # times that one takes a leaf anew that was let go too soon
FURTHER = 0.3  # metres that one steps back from a leaf that does not clear the body
PUSHED_ON = np.radians(40)  # a leaf that stands open by more, away from one, is pushed on in walking through
ARRIVED = 0.35  # metres to the place beyond that count as there


class Pass(Stage):
    """Reach, pull (only where the leaf comes towards one), pass; an open door is walked through and gives way
    where it is touched.
    """

    def __init__(
        self, goal: Goal, ground: Ground, moment: Moment, solids: DistanceQuery, ik: bool = True
    ) -> None:
        super().__init__(goal)
        leaf = self.leaf = goal.moves(Leaf)
        self.ground, self._count = ground, ground.pause()
        self._stuck, self._stepped, self._angle, self._again = 0, 0, leaf.angle, 0
        self._solids, self._ik = solids, ik
        self.way: Passage = passage(leaf, moment.root[:2].astype(np.float64))
        self.grasp = Opening(leaf, self.way, solids, ik)
        heading = self.way.heading
        beyond = np.append(self.way.beyond, 0).astype(np.float32)
        if leaf.angle > (PUSHED_ON if self.way.push else OPENED - 0.2):
            self.grasp.yield_only()
            self.part = 2
            aside = (
                leaf if self.way.push and leaf.angle < OPENED else None
            )  # it gives way: no way round it, close past the jamb
            self.approach = Approach(
                ground,
                self.way.beyond,
                heading,
                Command("idle", beyond, heading),
                REACH,
                thing=aside,
                anyway=True,
            )
            return
        self._reach()

    def _reach(self) -> None:
        """Go to where the handle is taken."""
        facing, place = self.way.facing, self.grasp.grip().astype(np.float32)
        self.approach = Approach(
            self.ground, self.way.reach, facing, Command("open", place, facing, thing=self.goal.prop), HANDLE
        )

    def update(self, moment: Moment) -> Command:
        leaf, way, grasp = self.leaf, self.way, self.grasp
        if self.part == 0 and grasp.state in ("held", "released"):
            self._count -= 1
            if self._count <= 0:
                self._next(1 if not way.push and leaf.angle < OPENED else 2)
        elif self.part == 1:
            self._pull(moment)
        return self.approach.update(moment, self.arrived)

    def _pull(self, moment: Moment) -> None:
        """Stand back until the leaf lets one pass: further where one stands in its way, and take it anew
        where it was let go too soon.
        """
        leaf, grasp = self.leaf, self.grasp
        turned, self._angle = leaf.angle - self._angle, leaf.angle
        self._stuck = self._stuck + 1 if moment.speed < 0.1 and turned < STILL else 0
        root = moment.root.astype(np.float64)
        if leaf.angle >= OPENED - (0 if grasp.state == "held" else SHORT) and (
            not grasp.in_way(root) or self._stuck > STUCK
        ):
            self._next(2)
        elif self._stuck > STUCK or grasp.state == "free":
            self._stuck = 0
            if grasp.state != "held" and self._again < AGAIN:
                self._again, self.part, self._count = self._again + 1, 0, self.ground.pause()
                self.way = passage(leaf, moment.root[:2].astype(np.float64))
                self.grasp = Opening(leaf, self.way, self._solids, self._ik)
                self._reach()
            elif self._stepped == 0:
                self._stepped = 1
                self._next(1)
            else:
                grasp.let_go()
                self._next(2)

    def _next(self, part: int) -> None:
        self.part, way = part, self.way
        back = way.back - self._stepped * FURTHER * heading_to_direction(np.array(way.heading))
        action, place = ("idle+open", back) if part == 1 else ("walk+open", way.beyond)
        final = Command(action, np.append(place, 0).astype(np.float32), way.heading, thing=self.goal.prop)
        self.approach = Approach(
            self.ground, place, way.heading, final, ready=lambda moment: True, anyway=True
        )

    def arrived(self, moment: Moment) -> bool:
        return self.passed(moment) and moment.speed < 0.15

    def passed(self, moment: Moment) -> bool:
        far = float(np.linalg.norm(moment.root[:2] - self.way.beyond))
        ahead = float((moment.root[:2] - self.way.middle) @ heading_to_direction(np.array(self.way.heading)))
        return self.part == 2 and (far < ARRIVED or ahead > 1.0 > far)

    def target(self) -> tuple[Array | None, float, int]:
        return np.append(self.way.beyond, 0.0), self.way.heading, 2

    def end(self, reached: bool, again: bool = False) -> None:
        self.grasp.let_go()


def _places(goal: Goal, way: Way) -> list[Array | None]:
    """To the handle, and beyond the opening."""
    if isinstance(goal.prop, Front):
        return unshut.places(goal, way)
    through = passage(goal.moves(Leaf), way.here)
    return [through.reach, None, through.beyond]


def _begin(goal: Goal, start: StageStart) -> Stage:
    if isinstance(goal.prop, Front):
        return unshut.Unshut(goal, start)
    return Pass(goal, start.ground, start.moment, start.scene.environment, start.ik)


PERFORMER = Performer(_begin, _places)
