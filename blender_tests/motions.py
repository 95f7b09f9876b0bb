"""A motion without a network, and where Blender shows its joints."""

from __future__ import annotations

from pathlib import Path

import addon_utils
import bpy
import numpy as np

from nsm_core.body.skeleton import JOINTS, J
from nsm_core.rotations import heading_quat, quat_from_rotvec, quat_mul


def wandering_take(frames: int = 40, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """A smooth take through a wide range of poses that turns more than a full circle."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None, None] / 30
    vectors = rng.normal(0, 0.6, (1, J, 3)) * np.sin(
        rng.uniform(1, 5, (1, J, 3)) * t + rng.uniform(0, 6, (1, J, 3))
    )
    local = quat_from_rotvec(vectors)
    local[:, 0] = quat_mul(heading_quat(7 * t[:, 0, 0]), local[:, 0])
    hips = np.column_stack(
        (np.sin(2 * t[:, 0, 0]) * 2, t[:, 0, 0] * 1.3 - 1, 0.9 + 0.1 * np.cos(5 * t[:, 0, 0]))
    )
    return hips, local


def blender_heads(armature: bpy.types.Object, frames: range) -> np.ndarray:
    """World positions of the bones' heads (N, 23, 3), by Blender's own evaluation."""
    heads = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        heads.append([list(armature.matrix_world @ armature.pose.bones[n].head) for n in JOINTS])
    return np.array(heads)


def imported_bvh(path: Path) -> bpy.types.Object:
    """The armature that Blender's own importer makes of a BVH file of ours."""
    addon_utils.enable("io_anim_bvh")
    bpy.ops.import_anim.bvh(
        filepath=str(path), axis_forward="-Z", axis_up="Y", global_scale=0.01, rotate_mode="NATIVE"
    )
    return bpy.context.object
