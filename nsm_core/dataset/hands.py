"""Hands on things in composed motion: ways of the wrists to a grip and off it, arms that hold, a body that leans into reach."""

from __future__ import annotations

import numpy as np

from ..limbs import chain_frames, mul, place_limbs
from ..rotations import (
    Array,
    heading_quat,
    heading_to_direction,
    quat_from_axis_angle,
    quat_from_matrix,
    quat_from_rotvec,
    quat_slerp,
    rotate_planar,
)
from ..skeleton import ARMS, FEET, INDEX, OFFSETS, forward_kinematics

ARM_LENGTH = float(np.linalg.norm(OFFSETS[[ARMS[0][1], ARMS[0][2]]], axis=-1).sum())
COMFORT = 0.95 * ARM_LENGTH  # an arm that holds is at least a little bent
LEAN, SHIFT = np.radians(50), np.array((0.0, -0.04, -0.16))  # the most the trunk leans more, and the hips move, to reach down
_MOST = 1.3  # times that where the captured pose needs it
_SHARES = ((0, 0.2), (INDEX["Chest"], 0.3), (INDEX["Chest2"], 0.25), (INDEX["Chest3"], 0.25))
_SHOULDERS, _WRISTS = [arm[0] for arm in ARMS], [arm[2] for arm in ARMS]
_LEGS, _ANKLES = [leg[:3] for leg in FEET], [leg[2] for leg in FEET]
_WIDEN, _SMOOTH = 3, 7  # frames either side by which a lean comes early and stays, and over which it grows

# Arms that hold something before the body, local rotations of shoulder and elbow, right then left: upper arms hang a little
# off the sides, elbows at right angles.  IK starts from them, so elbows keep pointing down and back.
_HOLDING = np.array([(quat_from_rotvec(np.array((0.15, s * 1.25, 0.0))), quat_from_rotvec(np.array((0, 0, -s * 1.4)))) for s in (-1, 1)])
# World rotation of a hand that lies flat on a box's side with its fingers ahead, right then left, for heading 0.
_FLAT = quat_from_matrix(np.array([((0, 0, -s), (s, 0, 0), (0, -1, 0)) for s in (1.0, -1.0)]))
_OUT = 0.05  # metres that wrists swing out on their way past a thing's corners


def ease(t: Array) -> Array:
    """Minimum-jerk step of (...) from 0 to 1."""
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t * t)


def lead(wrists: Array, grips: Array, progress: Array, facing: Array) -> Array:
    """Places (T, 2, 3) of wrists on their way from where the motion has them to their grips, both (T, 2, 3).

    ``progress`` (T,) 0 free to 1 gripped; ``facing`` (T,) headings of the body.  Wrists go sideways first and ahead last, so
    that they come along the sides of what they grip.
    """
    t = progress[:, None, None]
    way = rotate_planar(grips - wrists, -facing[:, None])
    # Up early, over the edge of a table; down with the body.
    height = np.where(way[..., 2:] > 0, ease(t / 0.6), ease(t / 0.9))
    way = np.concatenate((ease(t / 0.6) * way[..., :1], ease((t - 0.25) / 0.75) * way[..., 1:2], height * way[..., 2:]), axis=-1)
    way[..., 0] += np.array((-1.0, 1.0)) * _OUT * np.sin(np.pi * ease(progress))[:, None]
    return wrists + rotate_planar(way, facing[:, None])


def place_hands(
    hips: Array, rotations: Array, grips: Array, progress: Array, facing: Array, behind: tuple[Array, float] | None = None
) -> Array:
    """Lead both wrists of a motion (T, ...) to ``grips`` (T, 2, 3) and keep them there; new local rotations (T, 23, 4).

    ``progress`` (T,) and ``facing`` (T,) as in ``lead``.  ``behind``, weights (T,) and metres: how firmly free wrists are kept
    that far behind their grips, off what a body bends over.  Hands turn flat to the sides of what they hold.
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
    level = mul(heading_quat(facing)[:, None], quat_from_axis_angle(np.array((1.0, 0, 0)), dip))
    flat = mul(level, np.broadcast_to(_FLAT, level.shape))
    hands = quat_slerp(world[:, _WRISTS], flat, np.repeat(weight[:, None], 2, axis=1))
    return place_limbs(hips.astype(np.float64), local, ARMS, targets, hands).astype(rotations.dtype)


def lean_into_reach(hips: Array, rotations: Array, grips: Array, active: Array) -> tuple[Array, Array]:
    """Lean the trunk and lower the hips of a motion (T, ...) where arms are too short for ``grips`` (T, 2, 3); the feet stay.

    ``active`` (T,) frames that must reach.  Returns new hips (T, 3) and local rotations (T, 23, 4).
    """
    amounts = np.linspace(0, _MOST, 14)
    frames = np.flatnonzero(active)
    need = np.zeros(len(hips))
    open_ = frames
    for k, a in enumerate(amounts):
        moved = _leant(hips[open_].astype(np.float64), rotations[open_].astype(np.float64), np.full(len(open_), a))
        shoulders, _ = chain_frames(*moved, tuple(_SHOULDERS))
        away = np.linalg.norm(shoulders - grips[open_], axis=-1).max(-1)
        need[open_] = amounts[min(k + 1, len(amounts) - 1)]
        need[open_[away <= COMFORT]] = a
        open_ = open_[away > COMFORT]
        if not len(open_):
            break
    if not need.any():
        return hips, rotations
    window = np.hanning(2 * _SMOOTH + 3)[1:-1]
    widest = np.lib.stride_tricks.sliding_window_view(np.pad(need, _WIDEN, mode="edge"), 2 * _WIDEN + 1).max(-1)
    amount = np.convolve(np.pad(widest, _SMOOTH, mode="edge"), window / window.sum(), mode="valid")
    positions, world = forward_kinematics(hips, rotations)
    moved_hips, local = _leant(hips.astype(np.float64), rotations.astype(np.float64), amount)
    local = place_limbs(moved_hips, local, _LEGS, positions[:, _ANKLES], world[:, _ANKLES])
    return moved_hips.astype(hips.dtype), local.astype(rotations.dtype)


def shift_of(height: Array) -> Array:
    """How hips at heights (...) move at the full amount, (..., 3) seen from the body: nearly sitting on the heels they stay."""
    return np.concatenate(
        (np.broadcast_to(SHIFT[:2], (*np.shape(height), 2)), (SHIFT[2] * np.clip((height - 0.32) / 0.3, 0, 1))[..., None]), axis=-1
    )


def _leant(hips: Array, local: Array, amount: Array) -> tuple[Array, Array]:
    """Hips and local rotations with the trunk pitched forward, shared by its joints, and the hips moved, by ``amount`` (T,)."""
    local = local.copy()
    x = np.array((1.0, 0, 0))
    for joint, share in _SHARES:
        pitch = quat_from_axis_angle(x, amount * LEAN * share)
        # The pelvis turns about its own axis, the spine about its parent's.
        local[:, joint] = mul(local[:, joint], pitch) if joint == 0 else mul(pitch, local[:, joint])
    ahead = -SHIFT[1] * _facing(local[:, 0])
    return hips + amount[:, None] * np.concatenate((ahead, shift_of(hips[:, 2])[:, 2:]), axis=1), local


def _facing(pelvis: Array) -> Array:
    """Planar unit vectors (T, 2) ahead of pelvis rotations (T, 4): at right angles to their side-to-side axis."""
    w, x, y, z = np.moveaxis(pelvis, -1, 0)
    side = np.stack((1 - 2 * (y * y + z * z), 2 * (x * y + w * z)), axis=-1)
    side /= np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9)
    return np.stack((side[:, 1], -side[:, 0]), axis=-1)


__all__ = ["ARM_LENGTH", "COMFORT", "ease", "lead", "lean_into_reach", "place_hands", "shift_of"]
