"""A synthetic walk whose true foot prints are known, for the tests of feet and of measures."""

from __future__ import annotations

import numpy as np

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import FEET, HIP_OVER_SEAT, INDEX, OFFSETS, TOE_HEIGHT, J
from nsm_core.rotations import heading_quat, heading_to_direction, quat_from_rotvec, quat_mul, quat_rotate

LEGS = (FEET[0][:3], FEET[1][:3])


def seated_rotations() -> np.ndarray:
    """Local rotations (J, 4) of who sits upright with arms as in the T-pose."""
    local = np.zeros((J, 4))
    local[:, 0] = 1
    for name in ("RightHip", "LeftHip"):
        local[INDEX[name]] = quat_from_rotvec(np.array((-1.4, 0, 0)))
    for name in ("RightKnee", "LeftKnee"):
        local[INDEX[name]] = quat_from_rotvec(np.array((1.4, 0, 0)))
    return local


def seated_pose() -> tuple[np.ndarray, np.ndarray]:
    hips, local = np.array((0.0, 0.0, 0.45 + HIP_OVER_SEAT)), seated_rotations()
    feet = np.array(((-0.12, -0.42, 0.085), (0.12, -0.42, 0.085)))
    return hips, place_limbs(hips, local, LEGS, feet)


STRIDE, STANCE = 32, 0.6  # frames of a cycle and the share of it a foot stands


def synthetic_walk(
    frames: int = 150, speed: float = 1.0, heading: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hips (T, 3), local rotations (T, 23, 4) and foot contacts (T, 2) of a walk that does not slide;
    float64.
    """
    t = np.arange(frames)
    ahead = heading_to_direction(np.asarray(heading))
    left = np.array((-ahead[1], ahead[0]))
    hips = np.zeros((frames, 3))
    hips[:, :2] = (speed / 30 * t)[:, None] * ahead
    hips[:, 2] = 0.88 + 0.012 * np.cos(4 * np.pi * t / STRIDE)
    local = np.zeros((frames, J, 4))
    local[..., 0] = 1
    local[:, 0] = heading_quat(np.full(frames, heading))
    length = speed / 30 * STRIDE
    toes, pitch, contacts = np.zeros((frames, 2, 3)), np.zeros((frames, 2)), np.zeros((frames, 2), bool)
    for side in (0, 1):
        cycle, phase = np.divmod(t + (0 if side == 0 else STRIDE // 2), STRIDE)
        phase = phase / STRIDE
        swing = np.clip((phase - STANCE) / (1 - STANCE), 0, 1)
        contacts[:, side] = phase < STANCE
        step = swing * swing * (3 - 2 * swing)
        along = (cycle + step + STANCE / 2 - (0 if side == 0 else 0.5)) * length + 0.1
        toes[:, side, :2] = along[:, None] * ahead + (1 if side else -1) * 0.09 * left
        toes[:, side, 2] = TOE_HEIGHT + 0.08 * np.sin(np.pi * swing) ** 2
        pitch[:, side] = 0.5 * np.sin(np.pi * swing) + 0.35 * np.clip((phase - 0.4) / 0.2, 0, 1) * (1 - swing)
    feet = quat_mul(local[:, :1], quat_from_rotvec(pitch[..., None] * np.array((1.0, 0, 0))))
    targets = toes - quat_rotate(feet, np.broadcast_to(OFFSETS[FEET[0][3]].astype(float), toes.shape))
    local = place_limbs(hips, local, (FEET[0][:3], FEET[1][:3]), targets, feet)
    return hips, local, contacts
