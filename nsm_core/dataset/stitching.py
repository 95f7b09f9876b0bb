"""Join captured pieces into one motion without a pop: root alignment, decaying offsets, feet held through seams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..clip import transform
from ..conventions import FPS
from ..rotations import Array, quat_conjugate, quat_from_rotvec, quat_mul, quat_normalize, quat_to_rotvec, rotate_planar

BLEND_FRAMES = 14  # how long the offset across a seam takes to fade


@dataclass
class Piece:
    """A stretch of motion placed in the world.

    ``hips`` (T, 3), ``rotations`` (T, J, 4) parent-relative, ``contacts`` (T, 2) of the feet.
    """

    hips: Array
    rotations: Array
    contacts: Array

    def __len__(self) -> int:
        return len(self.hips)


def place(hips: Array, rotations: Array, root: Array, heading: Array, to_root: Array, to_heading: Array) -> tuple[Array, Array]:
    """Move frames (T, ...) rigidly so that their roots (T, 2), (T,) come to lie on other roots."""
    turn = (to_heading - heading).astype(hips.dtype)
    moved = hips.copy()
    moved[:, :2] -= root
    hips, rotations = transform(moved, rotations, to_root, turn)
    return hips.astype(np.float32), rotations.astype(np.float32)


def fade(count: int, blend: int) -> Array:
    """Weights (count,) that fall from 1 to 0 over ``blend`` frames with zero speed and acceleration at both ends."""
    x = np.clip(np.arange(count) / blend, 0, 1)
    return (1 - x**3 * (x * (6 * x - 15) + 10)).astype(np.float32)


def soften_seam(hips: Array, rotations: Array, seam: int, blend: int = BLEND_FRAMES) -> None:
    """Remove the jump at frame ``seam`` of a motion (T, ...), in place.

    What frame ``seam`` lacks against the continuation of the frames before it is added and fades away
    (inertialisation): the pose offset starts whole and dies over ``blend`` frames.
    """
    if not 2 <= seam < len(hips):
        return
    expected_hips = 2 * hips[seam - 1] - hips[seam - 2]
    step = quat_to_rotvec(quat_mul(rotations[seam - 1], quat_conjugate(rotations[seam - 2])))
    expected = quat_mul(quat_from_rotvec(step), rotations[seam - 1])
    n = min(blend, len(hips) - seam)
    w = fade(n, blend)
    hips[seam : seam + n] += w[:, None] * (expected_hips - hips[seam])
    offset = quat_to_rotvec(quat_mul(expected, quat_conjugate(rotations[seam])))
    turns = quat_from_rotvec(w[:, None, None] * offset[None])
    rotations[seam : seam + n] = quat_normalize(quat_mul(turns, rotations[seam : seam + n]))


def join(pieces: list[Piece], blend: int = BLEND_FRAMES) -> tuple[Piece, list[int]]:
    """Join pieces end to end, softening every seam; returns the motion and the frames of the seams."""
    hips = np.concatenate([p.hips for p in pieces]).astype(np.float32)
    rotations = np.concatenate([p.rotations for p in pieces]).astype(np.float32)
    contacts = np.concatenate([p.contacts for p in pieces])
    seams = list(np.cumsum([len(p) for p in pieces])[:-1])
    for seam in seams:
        soften_seam(hips, rotations, int(seam), blend)
    return Piece(hips, rotations, contacts), [int(s) for s in seams]


def hold(hips: Array, rotations: Array, contacts: Array, frame: int, count: int, rng: np.random.Generator, reach: int = 4) -> Piece:
    """Stay near one frame of a motion for ``count`` frames, breathing to and fro over its neighbours."""
    low, high = max(frame - reach, 0), min(frame + reach, len(hips) - 1)
    period = rng.uniform(2.5, 4.0) * FPS
    where = np.clip(frame + (high - low) / 2 * np.sin(2 * np.pi * np.arange(count) / period), low, high)
    i = np.minimum(where.astype(int), len(hips) - 2)
    f = (where - i).astype(np.float32)
    held_hips = hips[i] + f[:, None] * (hips[i + 1] - hips[i])
    step = quat_to_rotvec(quat_mul(rotations[i + 1], quat_conjugate(rotations[i])))
    held = quat_mul(quat_from_rotvec(f[:, None, None] * step), rotations[i])
    return Piece(held_hips, quat_normalize(held), contacts[i] | contacts[i + 1])


def root_delta(root: Array, heading: Array, i: int, j: int) -> tuple[Array, float]:
    """Displacement (2,) of root j in the frame of root i, and the turn between them."""
    return rotate_planar(root[j] - root[i], -heading[i]), float(heading[j] - heading[i])


__all__ = ["BLEND_FRAMES", "Piece", "fade", "hold", "join", "place", "root_delta", "soften_seam"]
