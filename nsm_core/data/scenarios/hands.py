"""Hands on things in composed motion: ways of wrists to a grip and off it, arms that hold, and a hand laid on
a surface.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.ik.two_bone import place_limbs, place_wrists
from nsm_core.body.skeleton import ARM_LENGTH, ARMS, forward_kinematics
from nsm_core.rotations import (
    Array,
    heading_quat,
    heading_to_direction,
    quat_conjugate,
    quat_from_axis_angle,
    quat_from_matrix,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_rotate,
    quat_slerp,
    rotate_planar,
)
from nsm_core.signals import align_quaternions, ease, gaussian_smooth
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.scene import furniture

COMFORT = 0.95 * ARM_LENGTH  # an arm that holds is at least a little bent
ARM = 0.53  # metres from shoulder to wrist that an arm reaches without being quite straight
STRAIGHT = 0.541  # metres from shoulder to wrist of an arm that is not to be stretched further
MOST_BENT = np.radians(70)  # most that a hand turns in its wrist to lie on a surface
INWARD = 0.15  # slope at which the fingers come down on it
_SHOULDERS, _WRISTS = [arm[0] for arm in ARMS], [arm[2] for arm in ARMS]

# Arms that hold something before the body, local rotations of shoulder and elbow, right then left: upper arms
# hang a little
# off the sides, elbows at right angles.  IK starts from them, so elbows keep pointing down and back.
_HOLDING = np.array(
    [
        (quat_from_rotvec(np.array((0.15, s * 1.25, 0.0))), quat_from_rotvec(np.array((0, 0, -s * 1.4))))
        for s in (-1, 1)
    ]
)
# World rotation of a hand that lies flat on a box's side with its fingers ahead, right then left, for heading
# 0.
_FLAT = quat_from_matrix(np.array([((0, 0, -s), (s, 0, 0), (0, -1, 0)) for s in (1.0, -1.0)]))
_OVER = 0.07  # metres that wrists rise over on their way to arm rests
_OUT = 0.05  # metres that wrists swing out on their way past a thing's corners


def lead(wrists: Array, grips: Array, progress: Array, facing: Array) -> Array:
    """Places (T, 2, 3) of wrists on their way from where the motion has them to their grips, both (T, 2, 3).

    ``progress`` (T,) 0 free to 1 gripped; ``facing`` (T,) headings of the body.  Wrists go sideways first and
    ahead last, so that they come along the sides of what they grip.
    """
    t = progress[:, None, None]
    way = rotate_planar(grips - wrists, -facing[:, None])
    # Up early, over the edge of a table; down with the body.
    height = np.where(way[..., 2:] > 0, ease(t / 0.6), ease(t / 0.9))
    way = np.concatenate(
        (ease(t / 0.6) * way[..., :1], ease((t - 0.25) / 0.75) * way[..., 1:2], height * way[..., 2:]),
        axis=-1,
    )
    way[..., 0] += np.array((-1.0, 1.0)) * _OUT * np.sin(np.pi * ease(progress))[:, None]
    return wrists + rotate_planar(way, facing[:, None])


def place_hands(
    hips: Array,
    rotations: Array,
    grips: Array,
    progress: Array,
    facing: Array,
    behind: tuple[Array, float] | None = None,
) -> Array:
    """Lead both wrists of a motion (T, ...) to ``grips`` (T, 2, 3) and keep them there; new local rotations
    (T, 23, 4).

    ``progress`` (T,) and ``facing`` (T,) as in ``lead``.  ``behind``, weights (T,) and metres: how firmly
    free wrists are kept that far behind their grips, off what a body bends over.  Hands turn flat to the
    sides of what they hold.
    """
    local = rotations.astype(np.float64)
    positions, world = forward_kinematics(hips.astype(np.float64), local)
    wrists = positions[:, _WRISTS]
    if behind is not None:
        ahead = heading_to_direction(facing)[:, None]
        over = np.maximum(((wrists - grips)[..., :2] * ahead).sum(-1) + behind[1], 0) * behind[0][:, None]
        wrists = wrists - np.append(over[..., None] * ahead, np.zeros((*over.shape, 1)), axis=-1)
    targets = lead(wrists, grips, progress, facing)
    weight = ease(progress / 0.8)
    for side, arm in enumerate(ARMS):
        for k in (0, 1):
            rest = np.broadcast_to(_HOLDING[side, k], local[:, arm[k]].shape)
            local[:, arm[k]] = quat_slerp(local[:, arm[k]], rest, weight)
    away = grips - positions[:, _SHOULDERS]
    ahead = rotate_planar(away, -facing[:, None])
    dip = 0.65 * np.clip(np.arctan2(-ahead[..., 2], np.maximum(-ahead[..., 1], 0.05)), 0, 1.5)
    level = quat_mul(heading_quat(facing)[:, None], quat_from_axis_angle(np.array((1.0, 0, 0)), dip))
    flat = quat_mul(level, np.broadcast_to(_FLAT, level.shape))
    hands = quat_slerp(world[:, _WRISTS], flat, np.repeat(weight[:, None], 2, axis=1))
    return place_limbs(hips.astype(np.float64), local, ARMS, targets, hands).astype(rotations.dtype)


def lead_hand(
    hips: Array, rotations: Array, side: int, target: Array, weight: Array, normal: Array, along: Array
) -> Array:
    """Put the wrist of ``side`` on ``target`` (T, 3) by ``weight`` (T,) 0..1 and lay the hand on a surface.

    ``normal`` (T, 3) leads from the surface to the hand, which points as the forearm does but along the
    surface, drawn towards ``along`` (T, 3).  Returns new local rotations (T, 23, 4).
    """
    start, elbow, wrist = ARMS[side]
    positions, _ = forward_kinematics(hips, rotations)
    at = positions[:, wrist] + weight[:, None] * (target - positions[:, wrist])
    # What is out of reach on the way back is not reached for: a straight arm snaps.
    way = at - positions[:, start]
    away = np.linalg.norm(way, axis=-1, keepdims=True)
    at = positions[:, start] + way * np.minimum(1, STRAIGHT / away)
    hips = hips.astype(np.float64)
    placed = place_wrists(hips, rotations.astype(np.float64), side, at)
    # The plane in which a nearly straight arm bends is noise: it settles over a few frames.
    arm = gaussian_smooth(align_quaternions(placed[:, [start, elbow]]), 1.5)
    placed[:, [start, elbow]] = quat_normalize(arm)
    placed = place_wrists(hips, placed, side, at)
    placed[:, wrist] = rotations[:, wrist]  # in line with the forearm as it was
    positions, world = forward_kinematics(hips, placed)
    axis = np.array((-1.0 if side == 0 else 1.0, 0, 0))
    points = quat_rotate(world[:, wrist], np.broadcast_to(axis, at.shape))
    forearm = positions[:, wrist] - positions[:, elbow]
    forearm /= np.linalg.norm(forearm, axis=-1, keepdims=True)
    fingers = forearm - (forearm * normal).sum(-1, keepdims=True) * normal + along
    fingers = fingers / np.maximum(np.linalg.norm(fingers, axis=-1, keepdims=True), 1e-6) - INWARD * normal
    fingers /= np.linalg.norm(fingers, axis=-1, keepdims=True)
    cross = np.cross(points, fingers)
    sine, cosine = np.linalg.norm(cross, axis=-1), (points * fingers).sum(-1)
    angle = np.minimum(np.arctan2(sine, cosine), MOST_BENT) * weight
    swing = quat_from_rotvec(cross / np.maximum(sine, 1e-6)[:, None] * angle[:, None])
    placed[:, wrist] = quat_mul(quat_conjugate(world[:, elbow]), quat_mul(swing, world[:, wrist]))
    return quat_normalize(placed).astype(rotations.dtype)


def hands_on_arm_rests(
    hips: Array,
    rotations: Array,
    weight: Array,
    span: slice,
    piece: furniture.Furniture,
    goal: Array,
    heading: float,
) -> Array:
    """Lead the wrists of a sit (``span`` of (T, ...)) from where they were to the arm rests, by the sitting
    ``weight``, and lay the hands flat on them.
    """
    rotations = rotations.copy()
    # The arms follow the hips down: they leave the thighs' way late and come back to it early, and come down
    # on the rests from above.
    w = np.clip((weight - 0.35) / 0.65, 0, 1)[:, None] ** 1.5
    rise = _OVER * np.sin(np.pi * w) ** 2 * (0, 0, 1)
    for side, rest in enumerate(arm_rests(piece)):
        if rest is None:
            continue
        at = rotate_planar(
            rest - np.append(piece.require_seat().point[:2], 0), np.float64(heading)
        ) + np.append(goal[:2], 0)
        places = np.broadcast_to(at, (len(w), 3)) + rise / np.maximum(w, 1e-3)
        along = np.broadcast_to(np.append(0.5 * heading_to_direction(np.array(heading)), 0), places.shape)
        up = np.broadcast_to((0.0, 0.0, 1.0), places.shape)
        rotations[span] = lead_hand(hips[span], rotations[span], side, places, w[:, 0], up, along)
    return rotations


__all__ = ["hands_on_arm_rests", "lead", "lead_hand", "place_hands"]
