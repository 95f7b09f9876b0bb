"""Toes that give way to what a foot comes down on or leaves: bent up where they would be inside it."""

from __future__ import annotations

import numpy as np

from nsm_core.body.capsules import Figure
from nsm_core.body.contacts import TOES, foot_heading
from nsm_core.rotations import Array, heading_to_direction, quat_from_axis_angle, quat_mul, quat_rotate

from .footsteps import FootGround

MOST = np.radians(65)  # by which toes are bent up


def bent_up(figure: Figure, hips: Array, local: Array, ground: FootGround) -> Array:
    """Local rotations (T, 23, 4) of a motion, hips (T, 3), whose toes are bent up out of the ``ground``."""
    positions, world = figure.tree.forward(hips, local)
    centre, radius = figure.tip
    radius = min(radius, figure.sole.toe_height + centre[2])  # a foot that stands is as it is
    out = np.array(local, dtype=np.float64)
    for toe in TOES:
        way = quat_rotate(world[:, toe], np.broadcast_to(centre, hips.shape))
        ahead = np.append(heading_to_direction(foot_heading(world[:, toe])), np.zeros((len(hips), 1)), 1)
        level = (way * ahead).sum(1)
        size = np.hypot(level, way[:, 2])
        tip = positions[:, toe, :2] + (level + radius)[:, None] * ahead[:, :2]
        least = ground.height(tip) + radius - positions[:, toe, 2]  # of the tip over the toe joint
        lack = np.arcsin(np.clip(least / np.maximum(size, 1e-9), -1, 1)) - np.arctan2(way[:, 2], level)
        turn = np.clip(lack, 0.0, MOST)
        out[:, toe] = quat_mul(local[:, toe], quat_from_axis_angle(np.array((-1.0, 0.0, 0.0)), turn))
    return out


__all__ = ["bent_up"]
