"""Touch: walk to where a hand reaches a point, put its fingers there, and stand.

The network is told to walk and to stand, and no more: the hand is led by the reach that other actions end
with.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nsm_core.body.skeleton import ARMS, END_SITES, JOINTS
from nsm_core.control.goals import Goal, Moment, Taken
from nsm_core.conventions import HAND_CONTACTS, SIT
from nsm_core.rotations import (
    Array,
    heading_to_direction,
    quat_from_rotvec,
    quat_rotate,
    rotate_planar,
    wrap_angle,
)
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan

from .approach import Approach, Command, Ground
from .base import Performer, Stage
from .hold import Hold, Lead, SeenBody

# Standing places that are tried, in this order: metres from the point, and turns about it.
AWAY, TURNS = (0.5, 0.45, 0.55, 0.6), np.radians((0.0, 25.0, -25.0, 50.0, -50.0))
ASIDE = 0.15  # metres of the point beside the middle of the body: it lies before the shoulder
ROOM = 0.03  # metres of room beyond a body that a standing place needs
NEAR, FACING, SLOW = (
    0.25,
    np.radians(25),
    0.2,
)  # metres, radians and m/s within which one has come to stand there
SKIN = 0.02  # metres from the tip of the bones to the thing: fingers are as thick
LED = 0.5  # metres that a hand is led beyond where the network has it, which tells how long it takes
TOUCHES = 0.03  # metres between fingers and point that count as touching
ACROSS = 0.05  # metres that a point lies on the other side of the body before the left hand is taken
_TIPS = np.array([END_SITES[JOINTS[arm[2]]] for arm in ARMS], dtype=np.float64)


def stand_of(goal: Goal, plan: FloorPlan | None = None) -> tuple[Array, float]:
    """Where on the floor (2,) one stands to touch a point, and the heading there; the one with most room
    where none is free.
    """
    places = []
    for turn in TURNS:
        heading = goal.heading + float(turn)
        for away in AWAY:
            point = rotate_planar(
                np.array((-ASIDE, -away)), np.float64(heading)
            )  # from the stand; heading 0 faces -Y, its right is -X
            places.append((goal.position[:2].astype(np.float64) - point, heading))
    room = (
        np.ones(len(places)) if plan is None else np.asarray(plan.clearance(np.array([p for p, _ in places])))
    )
    free = np.flatnonzero(room > ROOM)
    return places[int(free[0]) if len(free) else int(room.argmax())]


class Touching:
    """One hand and the point that it touches; one call a frame from its creation until it has come back."""

    forearms, bears = False, 0.0

    def __init__(self, point: Array, hand: int, solids: DistanceQuery, ik: bool = True) -> None:
        """``point`` (3,) is where the tips of the fingers come to rest, world; on the way the hand goes round
        ``solids``.
        """
        self.prop = None
        self.point, self.hand, self.solids, self.ik = np.asarray(point, dtype=np.float64), hand, solids, ik
        self.state = "reach"  # then "held", or "free" once it returns
        self.hold = Hold([hand], LED)
        self.errors: dict[str, Any] = {}
        self._fingers: Array | None = None  # from the wrist to the tips, world
        self._turn: Array | None = None  # of the hand, about world axes, so that they point there

    @property
    def active(self) -> bool:
        """Whether it still has to be called."""
        return self.state != "free" or self.hold.busy

    @property
    def touches_it(self) -> bool:
        """Whether the fingers are there."""
        return self.state == "held" and self.hold.lacking < TOUCHES

    def holds(self, hand: int) -> float:
        """How far a hand is led by it, 0..1."""
        return self.hold.weight if hand == self.hand else 0.0

    def touches(self, hand: int) -> bool:
        """Whether a hand is meant to touch a prop: it touches what stands still alone."""
        return False

    def let_go(self) -> None:
        """End it at any time: the hand returns."""
        self.state = "free"
        if self.hold.weight > 0:
            self.hold.release()

    def give_way(self) -> None:
        """Leave the hand to another."""
        self.let_go()

    @property
    def leads(self) -> list[Lead]:
        """Where its hand is to be in this frame, and where its fingers point."""
        return [replace(lead, turn=self._pointed(lead.share)) for lead in self.hold.leads]

    def _pointed(self, share: float) -> Array | None:
        """What the hand is turned by (4,) that is led this firmly."""
        return None if self._turn is None else np.asarray(quat_from_rotvec(share * self._turn))

    def apply(self, seen: SeenBody, root: Array, contacts: Array) -> None:
        """Lead the hand by one frame; ``root`` (3,), network ``contacts`` (5,)."""
        if self._fingers is None:  # as they will point with the arm held out
            way = self.point - seen.shoulders[self.hand]
            length = float(np.linalg.norm(_TIPS[self.hand]))
            self._fingers = way * (length / max(float(np.linalg.norm(way)), 1e-9))
        place = self.point - self._fingers
        if self.state == "reach":
            # Nothing is asked of the network, whose hand hangs at its side: it is drawn wherever it is.
            self.hold.approach(np.zeros(1), contacts[[HAND_CONTACTS[self.hand]]])
        self.hold.apply(seen, place[None])
        if self.hold.busy:
            wrist = ARMS[self.hand][2]
            self._turn = _between(quat_rotate(seen.joints[1][wrist], _TIPS[self.hand]), self._fingers)
        if self.state == "reach" and self.hold.complete(self.ik):
            self.state = "held"
            network = float(np.linalg.norm(seen.wrists[self.hand] - place))
            self.errors = {"network_hand_error_cm": 100 * network, "taken": Taken([self.hand], place[None])}


def _between(a: Array, b: Array) -> Array:
    """Rotation vector (3,) of the least turn that takes the direction of ``a`` (3,) to that of ``b`` (3,)."""
    axis = np.cross(a, b)
    size = float(np.linalg.norm(axis))
    return np.asarray(axis * (np.arctan2(size, float(a @ b)) / max(size, 1e-9)))


class Touch(Stage):
    """Come to stand within reach, put the hand there, and keep it there as long as the goal holds."""

    def __init__(self, goal: Goal, ground: Ground, solids: DistanceQuery, ik: bool = True) -> None:
        super().__init__(goal)
        self.solids, self.ik = solids, ik
        self.stand, self.heading = stand_of(goal, ground.plan)
        final = Command("idle", np.append(self.stand, 0.0).astype(np.float32), self.heading)
        self.approach = Approach(ground, self.stand, self.heading, final)
        self.grasp: Touching | None = None

    def _there(self, moment: Moment) -> bool:
        near = float(np.linalg.norm(moment.root[:2] - self.stand)) < NEAR
        facing = abs(float(wrap_angle(moment.heading - self.heading))) < FACING
        return near and facing and moment.speed < SLOW and float(moment.style[SIT]) < 0.1

    def update(self, moment: Moment) -> Command:
        if self.grasp is None and self._there(moment):
            self.part = 1
            point = self.goal.position - SKIN * np.append(
                heading_to_direction(np.array(self.goal.heading)), 0.0
            )
            beside = rotate_planar(point[:2] - moment.root[:2], np.float64(-moment.heading))
            self.grasp = Touching(point, int(beside[0] > ACROSS), self.solids, self.ik)
        return self.approach.update(moment, self._there)

    def arrived(self, moment: Moment) -> bool:
        return self.grasp is not None and self.grasp.touches_it and moment.speed < 0.15

    def target(self) -> tuple[Array | None, float, int]:
        return np.append(self.stand, 0.0), self.heading, 2

    def end(self, reached: bool, again: bool = False) -> None:
        if self.grasp is not None:
            self.grasp.let_go()


PERFORMER = Performer(
    lambda goal, start: Touch(goal, start.ground, start.scene.environment, start.ik),
    lambda goal, way: [stand_of(goal, way.plan)[0]],
)

__all__ = ["PERFORMER", "Touch", "Touching", "stand_of"]
