"""Hands that are led onto things: where wrists are, and a body that reaches a little further than its
arms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.skeleton import ARM_LENGTH, ARMS, FEET, INDEX
from nsm_core.conventions import DT
from nsm_core.rotations import Array, quat_conjugate, quat_from_rotvec, quat_mul, quat_rotate
from nsm_core.signals import smooth_step
from nsm_core.world.geometry.distance import DistanceQuery

from .hand_ways import HandWays
from .two_bone import SOFT_REACH, chain_frames, limb_frames, place_limbs

TAKE_TIME, LET_GO_TIME = 0.3, 0.4  # seconds in which a hand is drawn onto its place, and given back
SWIFT, CLOSING = (
    3.0,
    0.003,
)  # times faster where it says that it holds; metres a frame by which a hand on its way comes nearer
# A hand may be drawn from this near, metres: where it has stayed this near for DWELL frames or is at its
# place, or says it holds.
NEAR, NEAR_IN_CONTACT, THERE, DWELL = 0.25, 0.35, 0.07, 8
TOUCH, WAIT = 0.005, 15  # metres that an arm may lack to hold; frames after which it holds all the same
GONE = 0.5  # metres from which on a hand that was being drawn is given up
MOST_LEAN, LEAN_SPEED = np.radians(25), np.radians(75)  # of the trunk; radians a second
LED_SPEED, LEAN_FURTHER = (
    0.6,
    np.radians(100),
)  # m/s at which hands are led further than the network has them; lean for that, a metre
ARC, ARC_SHARE = (
    0.08,
    0.5,
)  # metres at most, and a metre that they are led further, by which hands go off the straight way
LEANT_REACH = (
    0.96  # of its length to which an arm is stretched by who leans: a straight one snaps as it bends
)
MOST_SHIFT, SHIFT_SPEED = 0.08, 0.3  # of the hips, metres; m/s
_DOWNWARDS = 0.35  # share of the way to a place that leads down, from which bent knees help
_CHEST = INDEX["Chest"]
_LEGS = tuple(leg[:3] for leg in FEET)


@dataclass
class Pose:
    """One frame: ``hips`` (3,) and ``local`` rotations (23, 4), float64; ``wrists`` (2, 3) are the network's,
    world.
    """

    hips: Array
    local: Array
    wrists: Array

    def arms(self) -> tuple[Array, Array]:
        """Shoulders and wrists (2, 3), right and left, world, of the pose as it is now."""
        joints, _, _ = limb_frames(self.hips, self.local, ARMS)
        return joints[:, 0], joints[:, 2]


class Hold:
    """How far hands (n,) are led onto their places: 0 free, 1 there; what is left of it when let go fades."""

    def __init__(self, hands: list[int], further: float = 0.0, crouch: float = 0.0) -> None:
        """``further`` metres that hands are led on from where the network has them: that takes longer, and a
        body leans more for it.

        ``crouch`` metres that knees bend for what is low, before the trunk leans.
        """
        self.hands = hands
        self._slower = 1 + further / LED_SPEED / TAKE_TIME
        self._stretched = LEANT_REACH if further else SOFT_REACH
        self._ways = HandWays(hands, min(ARC, ARC_SHARE * further))
        self._most_lean = MOST_LEAN + LEAN_FURTHER * further
        self._crouch, self._sunk = crouch, 0.0
        self.lean_share = 1.0  # 0..1 of that, as far as there is room to lean
        self.weight = 0.0
        self.near = 0  # frames that the hands have been near their places
        self._far, self._closing = (
            np.inf,
            0.0,
        )  # metres to the places in the last frame, and how much that fell
        self._added = np.zeros((len(hands), 3))  # what was put on the pose's own wrists in the last frame
        self._left = np.zeros((len(hands), 3))  # the same at release
        self._fade = 0.0
        self._lean, self._shift = np.zeros(3), np.zeros(3)
        self._waited, self._missing = 0, np.inf  # frames held so far in vain; metres that the arms lack

    @property
    def busy(self) -> bool:
        """Whether anything is still added to the pose."""
        return self.weight > 0 or self._fade > 0 or bool(self._lean.any() or self._shift.any() or self._sunk)

    @property
    def lacking(self) -> float:
        """Metres that the arms lacked in the last frame, trunk and hips having done their part; infinite
        while not held.
        """
        return self._missing

    def approach(self, distances: Array, labels: Array) -> None:
        """Judge whether the hands are to be drawn: ``distances`` (n,) metres to their places, contact
        ``labels`` (n,).
        """
        far = float(distances.max())
        self.near = self.near + 1 if far < NEAR else 0
        self._far, self._closing = far, self._far - far
        touching = bool((labels > 0.5).all())
        drawn = self.near > DWELL or far < THERE or touching and far < NEAR_IN_CONTACT
        if drawn or (self.weight > 0 and far < GONE):
            pace = (1 + touching * (SWIFT - 1) / self._slower**2) * self._ways.ready
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

    def apply(self, pose: Pose, places: Array, solids: DistanceQuery | None = None) -> None:
        """Lead the hands of ``pose`` in place to ``places`` (n, 3), as far as they are held; on their way
        they go round ``solids``.
        """
        if not self.busy:
            return
        shoulders, now = (points[self.hands] for points in pose.arms())
        self._fade = max(0.0, self._fade - self._ways.ready * DT / (LET_GO_TIME * self._slower))
        held, left = float(smooth_step(self.weight)), float(smooth_step(self._fade))
        # Hands that take hold anew while the last hold still fades go from where they are.
        self._added = held * (places - now) + (1 - held) * left * self._left
        back = self.weight <= 0
        to, share = (now + self._left, left) if back else (places, held)
        targets = (
            now
            + self._added
            + self._ways.off_the_line(pose.hips, pose.local, now, to, share, places, solids, back)
        )
        shoulders = self._reach_out(pose, shoulders, targets)
        pose.local = place_limbs(pose.hips, pose.local, tuple(ARMS[h] for h in self.hands), targets)
        self._missing = (
            float(np.linalg.norm(targets - shoulders, axis=1).max()) - ARM_LENGTH
            if self.weight >= 1
            else np.inf
        )

    def _reach_out(self, pose: Pose, shoulders: Array, targets: Array) -> Array:
        """Lean the trunk and then shift the hips, smoothly and a little, towards what the arms do not reach.

        ``shoulders`` (n, 3) are those of the hands; returns where they are then.
        """
        active = self.weight > 0 or self._fade > 0
        lack = _lack(targets - shoulders, self._stretched) if active else np.zeros(3)
        if self._crouch and (lack.any() or self._sunk):
            self._sink(pose, targets - shoulders, lack)
            shoulders = shoulders - (0.0, 0.0, self._sunk)
            lack = _lack(targets - shoulders, self._stretched) if active else lack
        if lack.any() or self._lean.any():
            pivot, parent = (a[0] for a in chain_frames(pose.hips, pose.local, (_CHEST,)))
            lever = shoulders.mean(0) - pivot
            wanted = np.cross(lever, lack) / (lever @ lever)
            wanted *= min(1.0, self.lean_share * self._most_lean / max(float(np.linalg.norm(wanted)), 1e-9))
            self._lean = _follow(self._lean, wanted, LEAN_SPEED * DT)
            turn = quat_from_rotvec(self._lean)
            pose.local = pose.local.copy()
            pose.local[_CHEST] = quat_mul(
                quat_mul(quat_mul(quat_conjugate(parent), turn), parent), pose.local[_CHEST]
            )
            shoulders = pivot + quat_rotate(turn[None], shoulders - pivot)
            lack = _lack(targets - shoulders, self._stretched) if active else lack
        if lack.any() or self._shift.any():
            lack = lack * min(1.0, MOST_SHIFT / max(float(np.linalg.norm(lack)), 1e-9))
            lack[2] = min(lack[2], 0.0)  # legs can bend, not grow
            self._shift = _follow(self._shift, lack, SHIFT_SPEED * DT)
            _move_hips(pose, self._shift)
            shoulders = shoulders + self._shift
        return shoulders

    def _sink(self, pose: Pose, ways: Array, lack: Array) -> None:
        """Bend the knees as far as that takes the shoulders of the ways (n, 3), which ``lack`` (3,), within
        reach of what is low.
        """
        way = ways[int(np.linalg.norm(ways, axis=1).argmax())]
        down = float(-way[2] / max(np.linalg.norm(way), 1e-9))
        wanted = min(float(np.linalg.norm(lack)) / down, self._crouch) if down > _DOWNWARDS else 0.0
        self._sunk = float(_follow(np.array((self._sunk,)), np.array((wanted,)), SHIFT_SPEED * DT)[0])
        _move_hips(pose, np.array((0.0, 0.0, -self._sunk)))


def _lack(ways: Array, stretched: float) -> Array:
    """What the longest of the ways (n, 3) from shoulder to target goes beyond an arm stretched to a share of
    its length, (3,).
    """
    length = np.linalg.norm(ways, axis=1)
    worst = int(length.argmax())
    return ways[worst] * (max(0.0, length[worst] - stretched * ARM_LENGTH) / max(length[worst], 1e-9))


def _move_hips(pose: Pose, shift: Array) -> None:
    """Move the hips of a pose by ``shift`` (3,) in place; the feet stay."""
    ankles, feet = _ankles(pose)
    pose.hips = pose.hips + shift
    pose.local = place_limbs(pose.hips, pose.local, _LEGS, ankles, feet)


def _follow(now: Array, wanted: Array, step: float) -> Array:
    """Move ``now`` towards ``wanted`` by an eased step of at most ``step``."""
    change = 0.35 * (wanted - now)
    size = float(np.linalg.norm(change))
    now = now + change * min(1.0, step / max(size, 1e-9))
    return now if np.abs(now).max() > 1e-4 or np.abs(wanted).max() > 1e-4 else np.zeros(3)


def _ankles(pose: Pose) -> tuple[Array, Array]:
    """Ankles (2, 3) and their world rotations (2, 4) as they are now."""
    joints, rotations, _ = limb_frames(pose.hips, pose.local, _LEGS)
    return joints[:, 2], rotations[:, 2]
