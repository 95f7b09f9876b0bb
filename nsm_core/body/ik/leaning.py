"""Lean the trunk of composed motion so that hands reach their places: one lean over the spine, and how much
of it is needed.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ARM_LENGTH, ARMS, FEET, HIPS, INDEX, PARENTS, forward_kinematics
from nsm_core.rotations import Array, quat_conjugate, quat_from_rotvec, quat_mul, quat_rotate
from nsm_core.signals import gaussian_smooth

from .two_bone import chain_frames, place_limbs

# Joints that share a lean, from below, and their shares: of a trunk over a pelvis that stays, and of one that
# bends with it.
SPINE = tuple((INDEX[name], 0.25) for name in ("Chest", "Chest2", "Chest3", "Chest4"))
BEND = ((HIPS, 0.2), (INDEX["Chest"], 0.3), (INDEX["Chest2"], 0.25), (INDEX["Chest3"], 0.25))
COMFORT = 0.95 * ARM_LENGTH  # an arm that holds is at least a little bent
LEAN, SHIFT = (
    np.radians(50),
    np.array((0.0, -0.04, -0.16)),
)  # the most the trunk leans more, and the hips move, to reach down
_MOST = 1.3  # times that where the captured pose needs it
_WIDEN, _SMOOTH = 3, 7  # frames either side by which a lean comes early and stays, and over which it grows
ARM = 0.53  # metres from shoulder to wrist that an arm reaches without being quite straight
ASIDE, TWIST = (
    np.radians(30),
    np.radians(32),
)  # most that the trunk leans towards a place and turns the shoulder to it
_LEVELS = np.linspace(0, 1, 7)
_NECK = INDEX["Neck"]
_SHOULDERS = [arm[0] for arm in ARMS]
_LEGS, _ANKLES = [leg[:3] for leg in FEET], [leg[2] for leg in FEET]


def lean(
    rotations: Array,
    world: Array,
    turn: Array,
    shares: tuple[tuple[int, float], ...] = SPINE,
    head: float = 0.5,
) -> Array:
    """Turn the trunk by ``turn`` (T, 3), world rotation vectors, spread over joints by ``shares``; ``head``
    of it reaches the head.

    ``rotations`` (T, 23, 4) local and ``world`` (T, 23, 4) of the same pose; returns new local rotations.
    """
    local, total = rotations.astype(np.float64), 0.0
    below = PARENTS[shares[0][0]]
    before = world[:, below].astype(np.float64) if below >= 0 else None
    for joint, share in shares:
        total += share
        now = quat_mul(quat_from_rotvec(turn * total), world[:, joint].astype(np.float64))
        local[:, joint] = now if before is None else quat_mul(quat_conjugate(before), now)
        before = now
    if head != 1:
        above = quat_mul(quat_from_rotvec(turn), world[:, PARENTS[_NECK]].astype(np.float64))
        local[:, _NECK] = quat_mul(
            quat_conjugate(above), quat_mul(quat_from_rotvec(turn * head), world[:, _NECK].astype(np.float64))
        )
    return local


def lean_into_reach(hips: Array, rotations: Array, grips: Array, active: Array) -> tuple[Array, Array]:
    """Lean the trunk and lower the hips of a motion (T, ...) where arms are too short for ``grips`` (T, 2,
    3); the feet stay.

    ``active`` (T,) frames that must reach.  Returns new hips (T, 3) and local rotations (T, 23, 4).
    """
    amounts = np.linspace(0, _MOST, 14)
    frames = np.flatnonzero(active)
    need = np.zeros(len(hips))
    open_ = frames
    positions, world = forward_kinematics(hips, rotations)
    for k, a in enumerate(amounts):
        moved = _bent(hips[open_].astype(np.float64), rotations[open_], world[open_], np.full(len(open_), a))
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
    widest = np.lib.stride_tricks.sliding_window_view(np.pad(need, _WIDEN, mode="edge"), 2 * _WIDEN + 1).max(
        -1
    )
    amount = np.convolve(np.pad(widest, _SMOOTH, mode="edge"), window / window.sum(), mode="valid")
    moved_hips, local = _bent(hips.astype(np.float64), rotations, world, amount)
    local = place_limbs(moved_hips, local, _LEGS, positions[:, _ANKLES], world[:, _ANKLES])
    return moved_hips.astype(hips.dtype), local.astype(rotations.dtype)


def shift_of(height: Array) -> Array:
    """How hips at heights (...) move at the full amount, (..., 3) seen from the body: nearly sitting on the
    heels they stay.
    """
    return np.concatenate(
        (
            np.broadcast_to(SHIFT[:2], (*np.shape(height), 2)),
            (SHIFT[2] * np.clip((height - 0.32) / 0.3, 0, 1))[..., None],
        ),
        axis=-1,
    )


def _bent(hips: Array, rotations: Array, world: Array, amount: Array) -> tuple[Array, Array]:
    """Hips (T, 3) and local rotations with the trunk pitched forward and the hips moved, by
    ``amount`` (T,).
    """
    side = quat_rotate(world[:, HIPS].astype(np.float64), np.broadcast_to((1.0, 0, 0), hips.shape))
    ahead = np.stack((side[:, 1], -side[:, 0]), axis=-1)
    ahead *= -SHIFT[1] / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
    moved = hips + amount[:, None] * np.concatenate((ahead, shift_of(hips[:, 2])[:, 2:]), axis=1)
    return moved, lean(rotations, world, (amount * LEAN)[:, None] * side, BEND, head=1.0)


def lean_to(hips: Array, rotations: Array, side: int, target: Array, weight: Array) -> Array:
    """Lean the trunk (T, ...) so that the shoulder of ``side`` comes within an arm's reach of ``target`` (T,
    3).

    ``weight`` (T,) 0..1 tells how much a frame asks for it.  Returns new local rotations.
    """
    positions, world = forward_kinematics(hips, rotations)
    way = (target - positions[:, HIPS]) * (1, 1, 0)
    way /= np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
    most = ASIDE * np.cross((0, 0, 1.0), way) + np.array((0, 0, TWIST * (1 if side == 0 else -1)))
    spans = []
    for level in _LEVELS:
        leant = lean(rotations, world, level * most)
        spans.append(np.linalg.norm(forward_kinematics(hips, leant)[0][:, ARMS[side][0]] - target, axis=-1))
    far = np.array(spans) - ARM  # (levels, T)
    needed = np.array([_first_root(far[:, t]) for t in range(len(hips))]) * (weight > 0)
    # What one frame needs its neighbours come and go with.
    held = weight > 0.999
    needed = np.where(held, needed, 0)
    if held.any():
        a, b = np.flatnonzero(held)[[0, -1]]
        needed[:a], needed[b + 1 :] = needed[a], needed[b]
        wide = np.max([np.roll(np.pad(needed, 6, mode="edge"), k)[6:-6] for k in range(-4, 5)], axis=0)
        needed = np.clip(gaussian_smooth(wide, 2.0), 0, 1)
    return lean(rotations, world, (needed * weight)[:, None] * most).astype(rotations.dtype)


def _first_root(values: Array) -> float:
    """The least level at which ``values`` (levels,) come down to 0; 1 where they never do."""
    if values[0] <= 0:
        return 0.0
    below = np.flatnonzero(values <= 0)
    if not len(below):
        return float(_LEVELS[int(values.argmin())])
    k = int(below[0])
    share = values[k - 1] / (values[k - 1] - values[k])
    return float(_LEVELS[k - 1] + share * (_LEVELS[k] - _LEVELS[k - 1]))
