"""Rotation channels of bones and objects, in whatever mode they are."""

from __future__ import annotations

import numpy as np
from mathutils import Quaternion

from nsm_core.rotations import Array, quat_to_rotvec

_ROTATION_OF = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}


def rotation_channel(mode: str) -> str:
    """The channel that turns an object or a bone of this rotation mode."""
    return _ROTATION_OF.get(mode, "rotation_euler")


def rotation_values(mode: str, basis: Array) -> Array:
    """Values (T, 3 or 4) of the rotation channel in ``mode`` for quaternions (T, 4), without jumps where
    these have none.
    """
    if mode == "QUATERNION":
        return basis
    if mode == "AXIS_ANGLE":
        vector = quat_to_rotvec(basis)
        angle = np.linalg.norm(vector, axis=-1, keepdims=True)
        axis = np.where(angle > 1e-9, vector / np.maximum(angle, 1e-9), (0.0, 1.0, 0.0))
        return np.concatenate((angle, axis), axis=-1)
    eulers = []
    for q in basis:
        euler = Quaternion(q).to_euler(mode, eulers[-1]) if eulers else Quaternion(q).to_euler(mode)
        eulers.append(euler)
    return np.array(eulers)


def continuous(q: Array) -> Array:
    """Flip signs along time so that (T, J, 4) quaternions never jump to the other cover."""
    flips = np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0, -1.0, 1.0)
    signs = np.concatenate((np.where(q[:1, ..., 0] < 0, -1.0, 1.0), flips))
    return q * np.cumprod(signs, axis=0)[..., None]
