"""The character's place and size in a scene, and putting a scene back as it was."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from nsm_core.rotations import Array, quat_normalize
from nsm_core.skeleton import HIPS, JOINTS

from .armature import Placement
from .channels import transform_of
from .keying import bone_channels


@dataclass(frozen=True)
class WorldFrame:
    """The core's world as one character sees it: its own metres, of which its legs are as long as the skeleton's; its floor at zero.

    ``scale`` is Blender units to such a metre, whatever the units of scene, object and bones are; ``floor`` a height, Blender units.
    """

    scale: float = 1.0
    floor: float = 0.0

    @classmethod
    def of(cls, armature: bpy.types.Object) -> WorldFrame:
        """Frame of a character: the size of its skeleton and its armature's height; SkeletonError as for ``Placement.of``."""
        placement = Placement.of(armature)
        return cls(placement.scale, float(placement.matrix[2, 3]))

    def to_core(self, points: Array) -> Array:
        """World points (..., 3), Blender units, in the core's frame."""
        return (np.asarray(points) - np.array((0, 0, self.floor))) / self.scale

    def to_world(self, points: Array) -> Array:
        """Core points (..., 3) in the world, Blender units."""
        return np.asarray(points, dtype=np.float64) * self.scale + np.array((0, 0, self.floor))


class SceneState:
    """What a take may disturb before its keys are made: the current frame, the character's pose and the places of ``moved`` objects."""

    def __init__(self, scene: bpy.types.Scene, armature: bpy.types.Object, moved: Iterable[bpy.types.Object] = ()) -> None:
        self.scene, self.armature = scene, armature
        self.places = [(moving, transform_of(moving)) for moving in moved]
        self.frame = (scene.frame_current, scene.frame_subframe)
        self.pose = {bone.name: transform_of(bone) for bone in armature.pose.bones}

    def restore(self) -> None:
        """Put frame, pose and places back exactly; what no longer exists is passed over."""
        if (self.scene.frame_current, self.scene.frame_subframe) != self.frame:
            self.scene.frame_set(self.frame[0], subframe=self.frame[1])
        for bone in self.armature.pose.bones:
            for channel, value in self.pose.get(bone.name, {}).items():
                setattr(bone, channel, value)
        for moving, place in self.places:
            for channel, value in place.items():
                setattr(moving, channel, value)
        bpy.context.view_layer.update()


class Preview:
    """Shows a pose on the character, and where it has moved things, while its take grows, without a key."""

    def __init__(self, armature: bpy.types.Object) -> None:
        self.armature, self.placement = armature, Placement.of(armature)

    def show(self, hips_world: Array, local_rotations: Array, moved: Iterable[tuple[bpy.types.Object, Matrix]] = ()) -> None:
        """Pose the character: hips (3,) world, Blender units, and rotations (23, 4) as in the core; put objects at world matrices."""
        rotations = quat_normalize(np.asarray(local_rotations, dtype=np.float64))[None]
        location, basis = bone_channels(self.armature, self.placement, np.asarray(hips_world, dtype=np.float64)[None], rotations)
        for j, name in enumerate(JOINTS):
            place = Matrix.Translation(Vector(location[0])) if j == HIPS else Matrix()
            self.armature.pose.bones[name].matrix_basis = place @ Quaternion(basis[0, j]).to_matrix().to_4x4()
        for moving, world in moved:
            moving.matrix_world = world
