"""Join captured pieces into one motion without a pop: root alignment, decaying offsets, feet held through
seams.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.clip import transform
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_to_rotvec,
)

BLEND_FRAMES = 14  # how long the offset across a seam takes to fade


def put_on_roots(
    hips: Array, rotations: Array, root: Array, heading: Array, to_root: Array, to_heading: Array
) -> tuple[Array, Array]:
    """Move frames (T, ...) rigidly so that their roots (T, 2), (T,) come to lie on other roots."""
    turn = (to_heading - heading).astype(hips.dtype)
    moved = hips.copy()
    moved[:, :2] -= root
    hips, rotations = transform(moved, rotations, to_root, turn)
    return hips.astype(np.float32), rotations.astype(np.float32)


def _quintic(count: int, blend: int) -> tuple[Array, Array]:
    """Weights (count,) of an offset and of its speed (per frame) that fade to rest over ``blend`` frames.

    Quintic Hermite basis: value, speed and acceleration are zero at the end.  Frame 0 is the one after the
    offset was met.
    """
    x = np.clip(np.arange(1, count + 1) / blend, 0, 1)
    value = 1 - 10 * x**3 + 15 * x**4 - 6 * x**5
    speed = (x - 6 * x**3 + 8 * x**4 - 3 * x**5) * blend
    return value.astype(np.float32), speed.astype(np.float32)


def soften_seam(hips: Array, rotations: Array, seam: int, blend: int = BLEND_FRAMES) -> None:
    """Remove the jump of pose and speed at frame ``seam`` of a motion (T, ...), in place.

    What the frames after the seam lack against the continuation of those before it, in place and in speed, is
    added and fades away over ``blend`` frames (inertialisation).
    """
    if not 2 <= seam < len(hips) - 2:
        return
    n = min(blend, len(hips) - seam)
    value, speed = _quintic(n, blend)
    before, after = hips[seam - 1] - hips[seam - 2], hips[seam + 1] - hips[seam]
    offset = hips[seam - 1] - (hips[seam] - after)
    hips[seam : seam + n] += value[:, None] * offset + speed[:, None] * (before - after)
    turn_before = quat_to_rotvec(quat_mul(rotations[seam - 1], quat_conjugate(rotations[seam - 2])))
    turn_after = quat_to_rotvec(quat_mul(rotations[seam + 1], quat_conjugate(rotations[seam])))
    expected = quat_mul(quat_from_rotvec(-turn_after), rotations[seam])
    turned = quat_to_rotvec(quat_mul(rotations[seam - 1], quat_conjugate(expected)))
    fading = value[:, None, None] * turned[None] + speed[:, None, None] * (turn_before - turn_after)[None]
    rotations[seam : seam + n] = quat_normalize(
        quat_mul(quat_from_rotvec(fading), rotations[seam : seam + n])
    )
