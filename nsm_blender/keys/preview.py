"""The pose of a take that grows, shown on its character without a key."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.rotations import Array, quat_normalize

from ..animation.kept import SceneState
from ..rigs.armature import Placement
from ..rigs.bone_map import bone_map_of
from .pose_channels import bone_channels, mounts_of, show_pose
from .switches import set_switches

__all__ = ["Preview", "SceneState"]


class Preview:
    """Shows a pose on the character, and where it has moved things, while its take grows, without a key."""

    def __init__(self, armature: bpy.types.Object) -> None:
        self.armature, self.placement = armature, Placement.of(armature)
        self.mounts, self.switches = mounts_of(armature, self.placement), bone_map_of(armature).properties

    def show(
        self, hips_world: Array, local_rotations: Array, moved: Iterable[tuple[bpy.types.Object, Matrix]] = ()
    ) -> None:
        """Pose the character: hips (3,) world, Blender units, and rotations (23, 4) as in the core; put
        objects at world matrices.
        """
        rotations = quat_normalize(np.asarray(local_rotations, dtype=np.float64))[None]
        hips = np.asarray(hips_world, dtype=np.float64)[None]
        places, basis = bone_channels(self.armature, self.placement, self.mounts, hips, rotations)
        show_pose(self.armature, self.placement, places, basis)
        for name, values in self.switches.items():
            set_switches(self.armature.pose.bones[name], values)
        for moving, world in moved:
            moving.matrix_world = world
