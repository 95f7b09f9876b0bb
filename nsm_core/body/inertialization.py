"""A motion goes on from another one without a pop: what it lacks at the seam is added and fades away."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_to_rotvec,
)

BLEND_FRAMES = 14  # how long the offset across a seam takes to fade


def _quintic(count: int, blend: int) -> tuple[Array, Array]:
    """Weights (count,) of an offset and of its speed (per frame) that fade to rest over ``blend`` frames.

    Quintic Hermite basis: value, speed and acceleration are zero at the end.  Frame 0 is the one after the
    offset was met.
    """
    x = np.clip(np.arange(1, count + 1) / blend, 0, 1)
    value = 1 - 10 * x**3 + 15 * x**4 - 6 * x**5
    speed = (x - 6 * x**3 + 8 * x**4 - 3 * x**5) * blend
    return value.astype(np.float32), speed.astype(np.float32)


def soften_places(places: Array, seam: int, blend: int = BLEND_FRAMES) -> None:
    """Remove the jump of place and speed at frame ``seam`` of points (T, ..., 3), in place.

    What the frames after the seam lack against the continuation of those before it, in place and in speed, is
    added and fades away over ``blend`` frames (inertialisation).
    """
    n = min(blend, len(places) - seam)
    value, speed = (w.reshape(-1, *[1] * (places.ndim - 1)) for w in _quintic(n, blend))
    before, after = places[seam - 1] - places[seam - 2], places[seam + 1] - places[seam]
    offset = places[seam - 1] - (places[seam] - after)
    places[seam : seam + n] += value * offset + speed * (before - after)


def soften_turns(rotations: Array, seam: int, blend: int = BLEND_FRAMES) -> None:
    """``soften_places`` of quaternions (T, ..., 4)."""
    n = min(blend, len(rotations) - seam)
    value, speed = (w.reshape(-1, *[1] * (rotations.ndim - 1)) for w in _quintic(n, blend))
    turn_before = quat_to_rotvec(quat_mul(rotations[seam - 1], quat_conjugate(rotations[seam - 2])))
    turn_after = quat_to_rotvec(quat_mul(rotations[seam + 1], quat_conjugate(rotations[seam])))
    expected = quat_mul(quat_from_rotvec(-turn_after), rotations[seam])
    turned = quat_to_rotvec(quat_mul(rotations[seam - 1], quat_conjugate(expected)))
    fading = value * turned[None] + speed * (turn_before - turn_after)[None]
    rotations[seam : seam + n] = quat_normalize(
        quat_mul(quat_from_rotvec(fading), rotations[seam : seam + n])
    )


def soften_seam(hips: Array, rotations: Array, seam: int, blend: int = BLEND_FRAMES) -> None:
    """Remove the jump of pose and speed at frame ``seam`` of a motion (T, 3), (T, J, 4), in place."""
    if 2 <= seam < len(hips) - 2:
        soften_places(hips, seam, blend)
        soften_turns(rotations, seam, blend)


__all__ = ["BLEND_FRAMES", "soften_places", "soften_seam", "soften_turns"]
