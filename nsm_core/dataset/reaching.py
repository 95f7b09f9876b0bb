"""A hand that reaches for a place, holds it while it moves, and comes back: the trunk leans as far as the arm asks for."""

from __future__ import annotations

import numpy as np

from ..limbs import mul, place_wrists, rotate
from ..rotations import Array, quat_conjugate, quat_from_rotvec, quat_normalize
from ..skeleton import ARMS, HIPS, INDEX, PARENTS, forward_kinematics
from .library import align_quaternions, gaussian_smooth

ARM = 0.53  # metres from shoulder to wrist that an arm reaches without being quite straight
STRAIGHT = 0.541  # metres from shoulder to wrist of an arm that is not to be stretched further
LEAN, TWIST = np.radians(30), np.radians(32)  # most that the trunk leans towards a place and turns the shoulder to it
BEND = np.radians(70)  # most that a hand turns in its wrist to lie on a surface
INWARD = 0.15  # slope at which the fingers come down on it
_SPINE = [INDEX[n] for n in ("Chest", "Chest2", "Chest3", "Chest4")]
_NECK = INDEX["Neck"]
_LEVELS = np.linspace(0, 1, 7)


def lean(rotations: Array, world: Array, turn: Array) -> Array:
    """Turn the trunk by ``turn`` (T, 3), world rotation vectors, spread over the spine; half of it reaches the head.

    ``rotations`` (T, 23, 4) local and ``world`` (T, 23, 4) of the same pose; returns new local rotations.
    """
    local = rotations.astype(np.float64)
    before = world[:, PARENTS[_SPINE[0]]].astype(np.float64)
    for k, joint in enumerate(_SPINE):
        now = mul(quat_from_rotvec(turn * (k + 1) / len(_SPINE)), world[:, joint].astype(np.float64))
        local[:, joint] = mul(quat_conjugate(before), now)
        before = now
    local[:, _NECK] = mul(quat_conjugate(before), mul(quat_from_rotvec(turn / 2), world[:, _NECK].astype(np.float64)))
    return local


def lean_to(hips: Array, rotations: Array, side: int, target: Array, weight: Array) -> Array:
    """Lean the trunk (T, ...) so that the shoulder of ``side`` comes within an arm's reach of ``target`` (T, 3).

    ``weight`` (T,) 0..1 tells how much a frame asks for it.  Returns new local rotations.
    """
    positions, world = forward_kinematics(hips, rotations)
    way = (target - positions[:, HIPS]) * (1, 1, 0)
    way /= np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
    most = LEAN * np.cross((0, 0, 1.0), way) + np.array((0, 0, TWIST * (1 if side == 0 else -1)))
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


def lead_hand(hips: Array, rotations: Array, side: int, target: Array, weight: Array, normal: Array, along: Array) -> Array:
    """Put the wrist of ``side`` on ``target`` (T, 3) by ``weight`` (T,) 0..1 and lay the hand on a surface.

    ``normal`` (T, 3) leads from the surface to the hand, which points as the forearm does but along the surface, drawn towards
    ``along`` (T, 3).  Returns new local rotations (T, 23, 4).
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
    points = rotate(world[:, wrist], np.broadcast_to(axis, at.shape))
    forearm = positions[:, wrist] - positions[:, elbow]
    forearm /= np.linalg.norm(forearm, axis=-1, keepdims=True)
    fingers = forearm - (forearm * normal).sum(-1, keepdims=True) * normal + along
    fingers = fingers / np.maximum(np.linalg.norm(fingers, axis=-1, keepdims=True), 1e-6) - INWARD * normal
    fingers /= np.linalg.norm(fingers, axis=-1, keepdims=True)
    cross = np.cross(points, fingers)
    sine, cosine = np.linalg.norm(cross, axis=-1), (points * fingers).sum(-1)
    angle = np.minimum(np.arctan2(sine, cosine), BEND) * weight
    swing = quat_from_rotvec(cross / np.maximum(sine, 1e-6)[:, None] * angle[:, None])
    placed[:, wrist] = mul(quat_conjugate(world[:, elbow]), mul(swing, world[:, wrist]))
    return quat_normalize(placed).astype(rotations.dtype)
