"""Hands that are led onto places and given back: how far they are, and where that puts them.

A hold never touches the pose: it emits where hands are to be, and whole takes are solved for it
(``body.ik``).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nsm_core.body.ik.grip import Grip
from nsm_core.body.skeleton import ARM_LENGTH, ARMS, INDEX, PARENTS, forward_kinematics
from nsm_core.conventions import DT
from nsm_core.rotations import Array, quat_conjugate, quat_from_rotvec, quat_mul
from nsm_core.signals import smooth_step

TAKE_TIME, LET_GO_TIME = 0.3, 0.4  # seconds in which a hand is drawn onto its place, and given back
# Times faster where it says that it holds; metres a frame by which a hand on its way comes nearer.
SWIFT, CLOSING = 3.0, 0.003
# A hand may be drawn from this near, metres: where it has stayed this near for DWELL frames or is at its
# place,
# or says it holds.
NEAR, NEAR_IN_CONTACT, THERE, DWELL = 0.25, 0.35, 0.07, 8
TOUCH, WAIT = 0.005, 15  # metres that an arm may lack to hold; frames after which it holds all the same
GONE = 0.5  # metres from which on a hand that was being drawn is given up
# What a body gives to an arm that is too short, metres: a lean of the trunk, a shift of the hips; and by the
# metre that hands are led further than the network has them.
LEAN, SHIFT, LEAN_FURTHER = 0.19, 0.08, 0.8
MOST_LEAN = np.radians(30)  # of a trunk to a place
_CHEST = INDEX["Chest"]
LED_SPEED = 0.6  # m/s at which hands are led further than the network has them


@dataclass
class SeenBody:
    """One frame as grasps see it: the network's ``hips`` (3,), ``local`` rotations (23, 4) and ``wrists``
    (2, 3), right and left, world, metres.
    """

    hips: Array
    local: Array
    wrists: Array

    @cached_property
    def joints(self) -> tuple[Array, Array]:
        """World positions (23, 3) and rotations (23, 4)."""
        return forward_kinematics(self.hips, self.local)

    @property
    def shoulders(self) -> Array:
        """World places (2, 3), right and left."""
        return self.joints[0][[arm[0] for arm in ARMS]]


@dataclass(frozen=True)
class Lead:
    """Where a ``hand`` (0 right, 1 left) is to be, ``target`` (3,) of its wrist, world, and how firmly, 0..1.

    ``turn`` (4,) is what the hand is turned by from how the pose has it, about world axes; None leaves it.
    ``grip`` tells how it lies on what it holds.  With ``bends`` the body bends over, and down, for what the
    arm does not reach; ``closed`` tells that fingers are closed about something.
    """

    hand: int
    target: Array
    share: float
    turn: Array | None = None
    grip: Grip | None = None
    bends: bool = False
    closed: bool = False


class Hold:
    """How far hands (n,) are led onto their places: 0 free, 1 there; what is left of it when let go fades."""

    def __init__(self, hands: list[int], further: float = 0.0) -> None:
        """``further`` metres that hands are led on from where the network has them: that takes longer, and a
        body leans more for it.
        """
        self.hands = hands
        self._slower = 1 + further / LED_SPEED / TAKE_TIME
        self._give = SHIFT + LEAN_FURTHER * further
        self.lean_share = 1.0  # 0..1 of the lean, as far as there is room to lean
        self.weight = 0.0
        self.near = 0  # frames that the hands have been near their places
        # Metres to the places in the last frame, and how much that fell.
        self._far, self._closing = np.inf, 0.0
        self._added = np.zeros((len(hands), 3))  # from the network's wrists to where they were led last
        self._left = np.zeros((len(hands), 3))  # the same at release
        self._fade = 0.0
        # Frames held so far in vain; metres that the arms lack when trunk and hips do their part.
        self._waited, self._missing = 0, np.inf
        self.leads: list[Lead] = []  # of this frame

    @property
    def busy(self) -> bool:
        """Whether hands are led anywhere."""
        return self.weight > 0 or self._fade > 0

    @property
    def lacking(self) -> float:
        """Metres that the arms lacked in the last frame, trunk and hips doing their part; infinite while not
        held.
        """
        return self._missing

    def leant(self, seen: SeenBody, places: Array) -> SeenBody:
        """About how the body will lean to ``places`` (n, 3), as far as they are held: what must keep off it
        takes that into account before the take is solved.
        """
        way = (places - seen.shoulders[self.hands]).mean(0)
        far = float(np.linalg.norm(way))
        lack = float(smooth_step(self.weight)) * max(far - ARM_LENGTH, 0.0)
        if not lack:
            return seen
        joints, world = seen.joints
        lever = seen.shoulders[self.hands].mean(0) - joints[_CHEST]
        turn = np.cross(lever, way * (lack / far)) / float(lever @ lever)
        turn *= min(1.0, MOST_LEAN * self.lean_share / max(float(np.linalg.norm(turn)), 1e-9))
        above, local = world[PARENTS[_CHEST]], seen.local.copy()
        leaning = quat_mul(
            quat_mul(quat_conjugate(above), quat_mul(quat_from_rotvec(turn), above)), local[_CHEST]
        )
        local[_CHEST] = leaning
        return SeenBody(seen.hips, local, seen.wrists)

    def approach(self, distances: Array, labels: Array) -> None:
        """Judge whether the hands are to be drawn: ``distances`` (n,) metres to their places, contact
        ``labels`` (n,).
        """
        far = float(distances.max())
        self.near = self.near + 1 if far < NEAR else 0
        self._far, self._closing = far, self._far - far
        touching = bool((labels > 0.5).all())
        drawn = self.near > DWELL or far < THERE or (touching and far < NEAR_IN_CONTACT)
        if drawn or (self.weight > 0 and far < GONE):
            pace = 1 + touching * (SWIFT - 1) / self._slower**2
            self.weight = min(1.0, self.weight + pace * DT / (TAKE_TIME * self._slower))
        else:
            self.weight = max(0.0, self.weight - DT / LET_GO_TIME)

    def complete(self, ik: bool) -> bool:
        """Whether the hands are where they hold; those still on their way, or that do not quite get there,
        are waited for, not for long.
        """
        self._waited = self._waited + 1 if self.weight >= 1 else 0
        ready = self._closing < CLOSING and (not ik or self._missing < TOUCH)
        return self.weight >= 1 and (ready or self._waited > WAIT)

    def release(self) -> None:
        """Let go; the hands return to where the pose has them.

        What fades is the offset from the pose, not the way to the place: hands that were moving with the body
        go on moving.
        """
        self._left, self._fade = self._added.copy(), 1.0
        self.weight = 0.0

    def apply(self, seen: SeenBody, places: Array) -> None:
        """Lead the hands to ``places`` (n, 3), world, as far as they are held; see ``leads``."""
        self.leads = []
        if not self.busy:
            return
        now = seen.wrists[self.hands].astype(np.float64)
        self._fade = max(0.0, self._fade - DT / (LET_GO_TIME * self._slower))
        held, left = float(smooth_step(self.weight)), float(smooth_step(self._fade))
        # Hands that take hold anew while the last hold still fades go from where they are.
        self._added = held * (places - now) + (1 - held) * left * self._left
        share = held + (1 - held) * left
        self.leads = [Lead(h, t, share) for h, t in zip(self.hands, now + self._added, strict=True)]
        self._missing = np.inf
        if self.weight >= 1:
            way = places - seen.shoulders[self.hands]
            far = np.linalg.norm(way, axis=1)
            give = self._give + LEAN * self.lean_share
            self._missing = float((far - give).max()) - ARM_LENGTH


__all__ = ["Hold", "Lead", "SeenBody"]
