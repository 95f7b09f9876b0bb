"""Elbows of arms that hold a box: they go outward where the arms would cut its corners."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ARMS
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_axis_angle,
    quat_mul,
    quat_rotate,
    rotate_planar,
)
from nsm_core.world.scene.props import Box

from .reaching import Pose
from .two_bone import limb_frames

SPEED, EASE = np.radians(5), 0.35  # a frame; share of the way that is gone in one
MARGIN = 0.01  # metres between skin and box
_TRIES = np.radians(np.arange(-30, 101, 10))
_PRICE = 0.02  # metres inside the box that half a turn of the elbow is worth
_UPPER, _LOWER = np.linspace(0.3, 1, 6), np.linspace(0, 0.85, 6)  # places along the bones
_RADII = np.concatenate((0.054 - 0.014 * _UPPER, 0.043 - 0.016 * _LOWER))  # as the body is seen
_OUTWARD = np.array(
    (1.0, -1.0)
)  # the sense about the line from shoulder to wrist that lifts the right and the left elbow out


class Elbows:
    """Swivels the elbows of one character about the lines from shoulders to wrists, smoothly; one call a
    frame.
    """

    def __init__(self) -> None:
        self.swivel = np.zeros(2)

    def apply(self, pose: Pose, box: Box, near: bool) -> None:
        """Turn the arms of ``pose`` in place off ``box`` where it is now; ``near`` tells whether hands are at
        it or on their way.
        """
        if not near and np.abs(self.swivel).max() < 1e-3:
            self.swivel[:] = 0
            return
        joints, rotations, parents = limb_frames(pose.hips, pose.local, ARMS)
        (starts, elbows, wrists), (upper, lower, hands) = (np.swapaxes(a, 0, 1) for a in (joints, rotations))
        line = wrists - starts
        line = line / np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), 1e-9)
        wanted = self._wanted(box, starts, elbows, wrists, line) if near else np.zeros(2)
        self.swivel += np.clip(EASE * (wanted - self.swivel), -SPEED, SPEED)
        turn = quat_from_axis_angle(line, _OUTWARD * self.swivel)
        new_upper, new_lower = quat_mul(turn, upper), quat_mul(turn, lower)
        pose.local = pose.local.copy()
        pose.local[[arm[0] for arm in ARMS]] = quat_mul(quat_conjugate(parents), new_upper)
        pose.local[[arm[2] for arm in ARMS]] = quat_mul(
            quat_conjugate(new_lower), hands
        )  # hands keep their turn

    def _wanted(self, box: Box, starts: Array, elbows: Array, wrists: Array, line: Array) -> Array:
        """Swivels (2,) that keep the arms out of the box, and are no larger than needed."""
        count = len(_TRIES)
        turn = quat_from_axis_angle(np.broadcast_to(line, (count, 2, 3)), _TRIES[:, None] * _OUTWARD)
        bent = starts + quat_rotate(turn, np.broadcast_to(elbows - starts, (count, 2, 3)))
        upper = starts + _UPPER[:, None, None, None] * (bent - starts)
        lower = bent + _LOWER[:, None, None, None] * (wrists - bent)
        points = np.concatenate((upper, lower))  # (places, tries, arms, 3)
        own = (
            np.abs(rotate_planar(points - box.pose[:3], np.float64(-box.pose[3]))) - np.asarray(box.size) / 2
        )
        distance = np.linalg.norm(np.maximum(own, 0), axis=-1) + np.minimum(own.max(-1), 0)
        deep = np.maximum(0, _RADII[:, None, None] + MARGIN - distance).max(0)
        return _TRIES[(deep + _PRICE * (_TRIES[:, None] / np.pi) ** 2).argmin(0)]


__all__ = ["Elbows"]
