"""What is written as BVH opens in Blender's own importer, joint for joint."""

from __future__ import annotations

import bpy
import numpy as np
from motions import imported_bvh

from nsm_core.body.skeleton import JOINTS, forward_kinematics
from nsm_core.data.captures import bvh_writer
from nsm_core.rotations import quat_normalize


def test_blender_reads_the_joints_where_they_were(tmp_path):
    """Channels in an order of their own for each joint, and angles beyond 180 degrees, are what other
    programs read.
    """
    rng = np.random.default_rng(1)
    steps = np.cumsum(rng.normal(size=(24, len(JOINTS), 4)) * 0.25, axis=0) + np.array((1.0, 0, 0, 0))
    hips, local = np.cumsum(rng.normal(size=(24, 3)) * 0.05, axis=0), quat_normalize(steps)
    bvh_writer.write_bvh(tmp_path / "take.bvh", hips, local)
    rig, (positions, _) = imported_bvh(tmp_path / "take.bvh"), forward_kinematics(hips, local)
    for frame in range(0, 24, 6):
        bpy.context.scene.frame_set(frame + 1)
        heads = [rig.matrix_world @ rig.pose.bones[name].head for name in JOINTS]
        np.testing.assert_allclose(heads, positions[frame], atol=1e-4)
