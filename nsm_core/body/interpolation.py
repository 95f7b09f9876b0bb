"""What a gap is filled with where nothing has been learnt, and how a motion is made to end at its target."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array, quat_slerp


def interpolated(hips: tuple[Array, Array], local: tuple[Array, Array], frames: int) -> tuple[Array, Array]:
    """Hips (frames + 1, 3) and local rotations (frames + 1, J, 4) after a pose and up to another, which is
    the last of them: linear in place and spherical in the joints' rotations (papers/001 section 7.1, INT).

    ``hips`` and ``local`` are those of both poses, (3,) metres and (J, 4).
    """
    share = np.arange(1, frames + 2) / (frames + 1)
    places = hips[0] + share[:, None] * (hips[1] - hips[0])
    count = frames + 1
    start, end = (np.broadcast_to(pose, (count, *pose.shape)) for pose in local)
    turns = quat_slerp(start, end, np.broadcast_to(share[:, None], (count, len(local[0]))))
    return places, turns


def target_blend(positions: Array, target: Array, duration: int) -> Array:
    """Positions (T, J, 3), the last of which stand for the frame of ``target`` (J, 3), corrected so that they
    meet it: by a share of what they lack there that grows evenly over ``duration`` frames (papers/001
    equations 15, 16).
    """
    left = np.arange(len(positions) - 1, -1, -1)
    share = np.maximum(0.0, 1.0 - left / duration)
    return np.asarray(positions + share[:, None, None] * (target - positions[-1]))


__all__ = ["interpolated", "target_blend"]
