"""Carry: walk to a box, take it, bring it, set it down, and stand free of it."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.control.load import pace_with
from nsm_core.conventions import IDLE
from nsm_core.rotations import Array, heading_to_direction, wrap_angle
from nsm_core.world.affordances.standing import (
    TOES_CLEAR,
    choose_side,
    further_off,
    require_room,
    standing_place,
)
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import Box

from .approach import CARRYING, Approach, Command, Ground
from .base import EXECUTED, Performer, Stage, StageStart, Way
from .box_grasp import Carrying

FETCH, BRING = 2.5, 2.2  # metres from which the box, and its place, are commanded themselves
PLACED, TRIES = (
    0.05,
    2,
)  # metres from its place at which a box counts as placed; how often one that slipped is fetched


class Carry(Stage):
    """Fetch, bring, release: each part is commanded as in the training data and begins by what the hands
    report.
    """

    def __init__(
        self,
        goal: Goal,
        ground: Ground,
        moment: Moment,
        solids: DistanceQuery,
        held: Carrying | None = None,
        ik: bool = True,
    ) -> None:
        """``solids``: what a box may rest on; ``held``: the hands that hold the same box already."""
        super().__init__(goal)
        self.box = goal.moves(Box)
        self.ground, self.solids, self.ik, self._tries = ground, solids, ik, 0
        self._pace = ground.pace
        if held is None:
            self._fetch(moment)
        else:
            self.grasp = held
            self._bring()

    @classmethod
    def of_held(cls, goal: Goal, start: StageStart, hands: Carrying) -> Carry:
        """Set down at ``goal`` what ``hands`` hold; what slips out of them on the way is left there."""
        made = cls(goal, start.ground, start.moment, start.scene.but(goal.prop), hands, start.ik)
        made._tries = TRIES
        return made

    @property
    def released(self) -> bool:
        """Whether hands have let go of the box for good."""
        return self.part % 3 == 2 or self.grasp.state in ("falling", "free")

    def _fetch(self, moment: Moment) -> None:
        box = self.box
        self.part, self._count = 3 * self._tries, self.ground.pause()
        self._tries += 1
        self.ground.pace = self._pace
        facing, stand, further = choose_side(
            box, self.ground.plan, moment.root[:2].astype(np.float64), solids=self.solids
        )
        heading = float(box.pose[3] + facing)
        self.grasp = Carrying(box, facing, self._goal_pose(facing), self.solids, self.ik, further)
        final = Command("carry", self._box_as_shown(), heading, thing=box)
        self.approach = Approach(self.ground, stand, heading, final, FETCH, anyway=self._tries > 1)

    def _goal_pose(self, facing: float) -> Array:
        return np.append(self.goal.position.astype(np.float64), wrap_angle(self.goal.heading - facing))

    def _box_as_shown(self) -> Array:
        """Where (3,) the network is told that the box is."""
        return (self.box.pose[:3] + self.box.shown).astype(np.float32)

    def _bring(self) -> None:
        box, heading = self.box, self.goal.heading
        self.part, self._count = self.part + 1, self.ground.pause()
        self.ground.pace = self._pace * pace_with(box.mass)
        further = further_off(box, self.grasp.facing, self.goal.position, heading, self.solids)
        self.grasp.send(self._goal_pose(self.grasp.facing), further)
        stand = standing_place(box, self.grasp.facing, self.goal.position, heading, further)
        # Told to set it down a little nearer, the body stands a little further off: toes stay out of a box on
        # the floor.
        nearer = self.goal.position[:2] - max(TOES_CLEAR, further) * heading_to_direction(np.array(heading))
        final = Command(
            "idle+carry",
            np.append(nearer, self.goal.position[2] + box.raised[2]).astype(np.float32),
            heading,
            thing=box,
        )
        self.approach = Approach(self.ground, stand, heading, final, BRING, CARRYING, thing=box, anyway=True)

    def update(self, moment: Moment) -> Command:
        state, doing = self.grasp.state, self.part % 3
        if doing == 0 and state == "held" or doing == 1 and state == "placed":
            self._count -= 1
            if self._count <= 0:
                self._go_on(moment)
        elif doing == 0 and self.approach.given:
            # A box that something has moved is reached for where it is.
            self.approach.final.position[:] = self._box_as_shown()  # type: ignore[index]
        return self._rest if self.part % 3 == 2 else self.approach.update(moment, self.arrived)

    def _go_on(self, moment: Moment) -> None:
        if self.part % 3 == 0:
            self._bring()
        elif not self._stands() and self._tries < TRIES:
            self._fetch(moment)  # it slipped out of the hands on the way
        else:
            self.part += 1
            self._rest = Command(
                "idle", np.append(moment.root[:2], 0).astype(np.float32), float(moment.heading)
            )

    def _stands(self) -> bool:
        return float(np.linalg.norm(self.box.pose[:3] - self.grasp.goal[:3])) < PLACED

    def arrived(self, moment: Moment) -> bool:
        return (
            self.part % 3 == 2
            and self._stands()
            and float(moment.style[IDLE]) > EXECUTED
            and moment.speed < 0.15
        )

    def passed(self, moment: Moment) -> bool:
        return self.part % 3 == 2 and self._stands()  # hands return on the way

    def target(self) -> tuple[Array | None, float, int]:
        return self.grasp.goal[:3], float(self.grasp.goal[3]), 3

    def end(self, reached: bool, again: bool = False) -> None:
        if not reached and self.grasp.state != "held":  # what is in the hands is the next goal's concern
            self.grasp.let_go()


def _begin(goal: Goal, start: StageStart) -> Carry:
    """Fetch the box, or bring it where hands that are still at work hold it."""
    hands: list[Carrying] = [g for g in start.grasps if isinstance(g, Carrying)]
    held = next((g for g in hands if g.prop is goal.prop and g.state == "held"), None)
    return Carry(goal, start.ground, start.moment, start.scene.but(goal.prop), held, start.ik)


def _places(goal: Goal, way: Way) -> list[Array | None]:
    """To the box, and to where it is set down."""
    box = goal.prop
    assert isinstance(box, Box)
    facing, stand, _ = choose_side(box, way.plan, way.here, way.poses.get(box.name, box.pose), way.solids)
    where = f"The place of {box.name}"
    require_room(box, np.append(goal.position, goal.heading - facing), way.solids, where)
    further = further_off(box, facing, goal.position, goal.heading, way.solids, where)
    way.poses[box.name] = np.append(goal.position, wrap_angle(goal.heading - facing))
    return [stand, standing_place(box, facing, goal.position, goal.heading, further)]


PERFORMER = Performer(_begin, _places)


__all__ = ["Carry"]
