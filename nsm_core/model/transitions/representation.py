"""World joint positions as the vectors of a transition network, and back (papers/001 section 3.2).

Plain arithmetic on leading axes, so that arrays and tensors alike can be told apart by nobody: training and
filling read features by the same lines.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nsm_core.body.skeleton import HIPS, J, root_of
from nsm_core.rotations import Array, rotate_planar

from .layout import PATCH_CELLS

_REST = slice(HIPS + 1, J)


def poses_of(positions: Array) -> Array:
    """Poses x (..., T, 69), not standardised, of world joints (..., T, 23, 3); the first frame is as fast as
    the second.
    """
    roots = positions[..., HIPS, :]
    velocity = np.diff(roots, axis=-2)
    velocity = np.concatenate((velocity[..., :1, :], velocity), axis=-2)
    joints = positions[..., _REST, :] - roots[..., None, :]
    return np.concatenate((velocity, joints.reshape(*joints.shape[:-2], -1)), axis=-1)


def targets_of(positions: Array) -> Array:
    """Targets t (..., 138), not standardised, of the world joints (..., 2, 23, 3) of the target frame and the
    one after it.  How fast the hips are says that one as well: the frame before is what is missing.
    """
    velocity = positions[..., 1, :, :] - positions[..., 0, :, :]
    flat = velocity.reshape(*velocity.shape[:-2], -1)
    return np.concatenate((poses_of(positions)[..., 0, :], flat), axis=-1)


def world_joints(pose: Any, root: Any) -> Any:
    """World joints (..., 69), hips first, of poses (..., 69) in physical units whose hips are at ``root``
    (..., 3).
    """
    joints = pose[..., 3:].reshape(*pose.shape[:-1], J - 1, 3) + root[..., None, :]
    flat = joints.reshape(*pose.shape[:-1], 3 * (J - 1))
    out = pose * 1  # an array of the same kind
    out[..., :3], out[..., 3:] = root, flat
    return out


def patches_of(heights: Array, root: Array) -> Array:
    """Patches p (..., 169), not standardised, of ground at ``heights`` (..., 169) around hips ``root``
    (..., 3).
    """
    if heights.shape[-1] != PATCH_CELLS**2:
        raise ValueError(f"a patch has {PATCH_CELLS**2} heights, not {heights.shape[-1]}")
    return heights - root[..., 2:]


def facing(positions: Array) -> Array:
    """Heading (...) of world joints (..., 23, 3), radians."""
    return root_of(positions)[1]


def turned(positions: Array, middle: Array, angle: Array) -> Array:
    """World joints (..., T, 23, 3) about ``middle`` (..., 2), which comes to the origin, turned by ``angle``
    (...) radians.
    """
    moved = positions.copy()
    moved[..., :2] -= middle[..., None, None, :]
    return rotate_planar(moved, np.asarray(angle)[..., None, None])


__all__ = ["facing", "patches_of", "poses_of", "targets_of", "turned", "world_joints"]
