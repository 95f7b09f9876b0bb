"""What keeps legs out of a block: how deep they are in it, and knees that go round it."""

from __future__ import annotations

from typing import Any

import numpy as np

from nsm_core.body.contacts import LEGS
from nsm_core.body.skeleton import END_SITES, FEET, HIPS, OFFSETS, forward_kinematics
from nsm_core.rotations import Array, quat_conjugate, quat_from_axis_angle, quat_mul, quat_rotate

from .footholds import Block


def leg_depths(hips: Array, rotations: Array, block: Block) -> Array:
    """How deep (T, 2) metres the right and left leg are in the block; negative is clearance.  Soles may press
    2.5 cm.
    """
    positions, world = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))
    depths = []
    for side, (start, knee, ankle, toe) in enumerate(FEET):
        tip = positions[:, toe] + quat_rotate(
            world[:, toe], np.array(END_SITES[("RightToe", "LeftToe")[side]])
        )
        points, radii = [], []
        for (a, b), (ra, rb) in zip(
            ((positions[:, start], positions[:, knee]), (positions[:, knee], positions[:, ankle]),
             (positions[:, ankle], positions[:, toe]), (positions[:, toe], tip)),
            ((0.04, 0.055), (0.05, 0.04), (0.015, 0.0), (0.0, -0.005)), strict=True,
        ):  # fmt: skip
            for share in np.linspace(0, 1, 6):
                points.append(a + share * (b - a))
                radii.append(ra + share * (rb - ra))
        at = np.stack(points, axis=1)
        beyond = np.concatenate(
            (np.abs(block.local(at[..., :2])) - block.half, at[..., 2:] - block.height), -1
        )
        distance = np.linalg.norm(beyond.clip(0), axis=-1) + np.minimum(beyond.max(-1), 0)
        depths.append((np.array(radii) - distance).max(1))
    return np.stack(depths, axis=1)


def shin_depth(hip: Array, ankle: Array, ahead: Array, block: Block) -> Array:
    """How deep (..., n) the shin is in the block, metres, with the knee bent ``ahead`` (n, 3); hip (n, 3),
    ankle (..., n, 3).

    All are given in the block's frame.
    """
    thigh, shin = (float(np.linalg.norm(OFFSETS[j])) for j in FEET[0][1:3])
    way = ankle - hip
    length = np.linalg.norm(way, axis=-1, keepdims=True)
    unit, span = way / length, np.clip(length, 0.15, 0.999 * (thigh + shin))
    bend = ahead - unit * (unit * ahead).sum(-1, keepdims=True)
    bend /= np.maximum(np.linalg.norm(bend, axis=-1, keepdims=True), 1e-6)
    cosine = np.clip((thigh**2 + span**2 - shin**2) / (2 * thigh * span), -1, 1)
    knee = hip + thigh * (cosine * unit + np.sqrt(1 - cosine**2) * bend)
    foot = hip + span * unit
    depth = np.zeros(ankle.shape[:-1])
    for share in (0.0, 0.3, 0.6, 0.85):
        point = knee + share * (foot - knee)
        beside = np.maximum(np.abs(point[..., 0]) - block.half[0], np.abs(point[..., 1]) - block.half[1])
        depth = np.maximum(depth, 0.045 - np.maximum(beside, point[..., 2] - block.height))
    return depth


def crosses(toes: Array, gap: tuple[Any, ...], block: Block) -> bool:
    """Whether the swing of a ``gap`` goes over the block."""
    side, begin, end, before, after = gap
    way = np.linspace(toes[begin - 1, side, :2] + before[:2], toes[end, side, :2] + after[:2], 20)
    return bool(before[2] or after[2] or block.holds(way, 0.0).any())


def splayed(
    positions: Array, rotations: Array, world: Array, feet: Array, gaps: list[Any], most: float
) -> tuple[Array, Array, Array]:
    """Turn legs about the line from hip to ankle so that their knees point outward in ``gaps``; the feet turn
    along by half.

    Returns rotations, feet and the angles (T, 2), radians, clockwise from above.
    """
    rotations, feet, t = rotations.astype(np.float64), feet.copy(), np.arange(len(rotations))
    angles = np.zeros((len(t), 2))
    for side, begin, end, *_ in gaps:
        start, _, ankle = LEGS[side]
        # The leg that leads has its knee before it; it is the other that has to go round.
        splay = most if begin > min(g[1] for g in gaps) else most / 2
        u = np.clip((t - begin + 8) / (end - begin + 8), 0, 1)
        angle = (splay, -splay)[side] * np.sin(np.pi * u**0.7) ** 2
        where = np.flatnonzero(u * (1 - u) > 0)
        angles[where, side] = angle[where]
        down = positions[where, ankle] - positions[where, start]
        down /= np.linalg.norm(down, axis=-1, keepdims=True)
        turn, hips = quat_from_axis_angle(down, angle[where]), world[where, HIPS]
        rotations[where, start] = quat_mul(
            quat_conjugate(hips), quat_mul(turn, quat_mul(hips, rotations[where, start]))
        )
        swing = np.arange(begin, end)
        u = (swing - begin + 1) / (end - begin + 1)
        yaw = quat_from_axis_angle(
            np.array((0.0, 0.0, -1.0)), 0.5 * (splay, -splay)[side] * np.sin(np.pi * u) ** 2
        )
        feet[swing, side] = quat_mul(yaw, feet[swing, side])
    return rotations, feet, angles
