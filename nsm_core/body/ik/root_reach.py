"""Bring the trunk to where hands and feet can reach their places: the root's part of full-body IK."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ARMS, FEET, OFFSETS, forward_kinematics
from nsm_core.rotations import Array

from .leaning import SPINE, lean
from .two_bone import SOFT_REACH

_MOST_LEAN, _MOST_SHIFT = np.radians(50), 0.5  # of the spine; of the hips, metres
_ROUNDS = 6


def within_reach(
    hips: Array, rotations: Array, before: Array, hands: Array, used: list[int], ankles: Array, free: bool
) -> tuple[Array, Array]:
    """Lean the spine, and shift the hips where they are ``free``, until hands and feet can reach their
    places.

    ``before`` (N, J, 3) joints of the original pose: a limb that was stretched further there may be so again.
    """
    start = hips
    legs, arms = [leg[:3] for leg in FEET], [ARMS[s] for s in used]
    turn = np.zeros((len(hips), 3))
    upright, world = rotations, forward_kinematics(hips, rotations)[1]
    for _ in range(_ROUNDS):
        joints = forward_kinematics(hips, rotations)[0]
        short = _shortfall(joints, before, arms, hands)
        if not short.any() and not (free and _shortfall(joints, before, legs, ankles).any()):
            break
        pivot = joints[:, SPINE[0][0]]
        lever = joints[:, [arm[0] for arm in arms]].mean(axis=1) - pivot if arms else np.zeros_like(pivot)
        turn += np.cross(lever, short) / np.maximum((lever**2).sum(-1, keepdims=True), 1e-6)
        size = np.linalg.norm(turn, axis=-1, keepdims=True)
        turn *= np.minimum(1, _MOST_LEAN / np.maximum(size, 1e-9))
        rotations = lean(upright, world, turn, head=1.0) if (size > 1e-9).any() else rotations
        if not free:
            continue
        joints = forward_kinematics(hips, rotations)[0]
        shift = (
            hips - start + _shortfall(joints, before, arms, hands) + _shortfall(joints, before, legs, ankles)
        )
        hips = start + shift * np.minimum(
            1, _MOST_SHIFT / np.maximum(np.linalg.norm(shift, axis=-1, keepdims=True), 1e-9)
        )
    return hips, rotations


def _shortfall(joints: Array, before: Array, chains: list[tuple[int, int, int]], targets: Array) -> Array:
    """Vector (N, 3) by which the start of the limb that misses its target (N, L, 3) most has to come
    nearer.
    """
    worst, most = np.zeros((len(joints), 3)), np.zeros((len(joints), 1))
    for (start, middle, end), target in zip(chains, np.moveaxis(targets, 1, 0), strict=True):
        length = SOFT_REACH * float(np.linalg.norm(OFFSETS[[middle, end]], axis=-1).sum())
        allowed = np.maximum(
            length, np.linalg.norm(before[:, end] - before[:, start], axis=-1, keepdims=True) + 1e-4
        )
        way = target - joints[:, start]
        distance = np.linalg.norm(way, axis=-1, keepdims=True)
        over = np.maximum(distance - allowed, 0)
        worst = np.where(over > most, way / np.maximum(distance, 1e-9) * over, worst)
        most = np.maximum(over, most)
    return worst
