"""Sitting down from the side: the seated body turns on the seat by small steps, as onto a chair pushed under
a desk.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import FEET, forward_kinematics
from nsm_core.data.scenarios.motion import Motion
from nsm_core.rotations import Array, heading_quat, quat_mul, rotate_planar
from nsm_core.signals import smooth_step

# Shares of the turn in which the leading and the other foot are in the air; each takes two steps.
_SWINGS = (((0.0, 0.27), (0.5, 0.77)), ((0.25, 0.52), (0.73, 1.0)))
_LIFT = 0.05  # metres


def swivel(
    motion: Motion, start: int, count: int, angle: float, tuck: float = 0.0, slide: Array | None = None
) -> None:
    """Turn a seated body about its hips by ``angle`` radians in ``count`` frames from frame ``start`` on,
    feet stepping along.

    Half way the feet are drawn in toward the hips by the share ``tuck`` of their distance, past what stands
    before the knees.
    ``slide`` (3,) metres: the hips come to their place on the way, the feet along.
    Changes ``motion`` in place: hips, rotations, headings and standing feet.  Later frames are left as they
    are.
    """
    span = slice(start, start + count)
    share = (np.arange(count) + 1) / count
    phi = angle * smooth_step(share)
    hips = motion.hips[span]
    before, world = forward_kinematics(hips, motion.rotations[span])
    ankles = [leg[2] for leg in FEET]
    base, feet = before[0, ankles], world[0, ankles]
    slide = np.zeros(3) if slide is None else slide
    moved = (hips + smooth_step(share)[:, None] * slide).astype(hips.dtype)
    turned = motion.rotations[span].copy()
    turned[:, 0] = quat_mul(heading_quat(phi), turned[:, 0])
    lead = int(angle > 0)  # 0 right, 1 left: the foot on the side one turns to goes first
    targets, rotations = np.empty((count, 2, 3)), np.empty((count, 2, 4))
    for side in (0, 1):
        swings = _SWINGS[0 if side == lead else 1]
        turn, lift = np.zeros(count), np.zeros(count)
        for (a, b), step in zip(swings, (0.5, 0.5), strict=True):
            x = np.clip((share - a) / (b - a), 0, 1)
            turn += step * smooth_step(x)
            lift += np.where((x > 0) & (x < 1), np.sin(np.pi * x) ** 2, 0)
            motion.feet[span, side] &= (x <= 0) | (x >= 1)
        offset = base[side] - hips[0]
        drawn_in = (1 - tuck * np.sin(np.pi * turn))[:, None] * np.array((1, 1, 0)) + np.array((0, 0, 1))
        targets[:, side] = hips + rotate_planar(offset * drawn_in, angle * turn) + turn[:, None] * slide
        targets[:, side, 2] = base[side, 2] + _LIFT * lift
        rotations[:, side] = quat_mul(heading_quat(angle * turn), np.repeat(feet[side][None], count, 0))
    motion.rotations[span] = place_limbs(
        moved, turned, tuple(leg[:3] for leg in FEET), targets, rotations
    ).astype(motion.rotations.dtype)
    motion.hips[span] = moved
    motion.headings[span] += phi


def turn_about_hips(motion: Motion, start: int, end: int, angle: float, slide: Array) -> None:
    """Turn frames from ``start`` to ``end`` by ``angle`` radians about the hips of frame ``start`` and move
    them by ``slide`` (3,).
    """
    span = slice(start, end)
    pivot: Array = motion.hips[start, :2].copy()
    offset = motion.hips[span].copy()
    offset[:, :2] -= pivot
    motion.hips[span] = rotate_planar(offset, np.full(end - start, angle, np.float32))
    motion.hips[span, :2] += pivot
    motion.hips[span] += slide.astype(motion.hips.dtype)
    motion.rotations[span, 0] = quat_mul(
        np.repeat(heading_quat(np.array(angle))[None], end - start, 0), motion.rotations[span, 0]
    )
    motion.headings[span] += angle
