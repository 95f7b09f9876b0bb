"""Poses of the three key joints at which hands work, and how far one is from the next (papers/002 section
6.3, equation 24).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import (
    Array,
    heading_to_direction,
    matrix_from_forward_up,
    rotate_planar,
    wrap_angle,
)
from nsm_core.world.affordances.reach import LEFT, RIGHT, Reach
from nsm_core.world.scene.wrist import WristPose

from .actions.carried import BEFORE, HIGH, WIDE

WEIGHT = 2.0  # of what lies between key poses beside what lies before the first (w of equation 24)
_RADIAN = 0.3  # metres that turning by a radian is worth
_HANGS, _CARRIES = (0.05, 0.25, 0.85), (BEFORE, WIDE, HIGH)  # metres ahead, aside and up of a wrist


@dataclass(frozen=True)
class KeyPose:
    """``root`` (3,), x, y and heading, and ``wrists`` (2, 3), right and left, world; ``turns`` (2, 3, 3) of
    these, world.
    """

    root: Array
    wrists: Array
    turns: Array

    @staticmethod
    def of(root: Array, works: dict[int, WristPose], carries: set[int]) -> KeyPose:
        """The pose of who stands at ``root`` (3,) with hands (0 right, 1 left) that have ``works`` to do, and
        others that hang, or those that carry something.
        """
        ahead = np.append(heading_to_direction(np.array(root[2])), 0.0)
        left, up = rotate_planar(ahead, np.float64(np.pi / 2)), np.array((0.0, 0.0, 1.0))
        poses = []
        for hand, side in enumerate((RIGHT, LEFT)):
            far, aside, high = _CARRIES if hand in carries else _HANGS
            place = np.append(root[:2], 0.0) + far * ahead + side * aside * left + high * up
            points = (ahead, up) if hand in carries else (-up, ahead)
            poses.append(works.get(hand) or WristPose(place, matrix_from_forward_up(*points)))
        wrists, turns = (np.stack([getattr(one, name) for one in poses]) for name in ("place", "rotation"))
        return KeyPose(np.asarray(root, dtype=np.float64), wrists, turns)


def standing_at(reach: Reach) -> Array:
    """The root (3,) of who stands so."""
    return np.append(reach.place, reach.heading)


def deviation(a: KeyPose, b: KeyPose) -> float:
    """How far the three key joints of a pose are from those of another, metres: ways and turns (Dev of
    equation 24).
    """
    away = np.linalg.norm(a.root[:2] - b.root[:2]) + _RADIAN * abs(wrap_angle(a.root[2] - b.root[2]))
    cosine = (np.trace(np.swapaxes(a.turns, 1, 2) @ b.turns, axis1=1, axis2=2) - 1) / 2
    turned = np.arccos(np.clip(cosine, -1, 1))
    return float(away + (np.linalg.norm(a.wrists - b.wrists, axis=1) + _RADIAN * turned).sum())


def cost(now: KeyPose, poses: list[KeyPose]) -> float:
    """What a sequence of key poses costs from ``now`` on: equation 24, whose sum over two is carried on over
    as many as there are.
    """
    if not poses:
        return 0.0
    between = (deviation(a, b) for a, b in zip(poses, poses[1:], strict=False))
    return deviation(now, poses[0]) + WEIGHT * sum(between)


__all__ = ["KeyPose", "cost", "deviation", "standing_at"]
