"""The character's place and size in a scene, and putting a scene back as it was."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from nsm_core.body.skeleton import HIPS, JOINTS
from nsm_core.rotations import Array, quat_normalize

from ..animation.kept import SceneState
from ..rigs.armature import Placement
from ..rigs.mount import Mount
from .keying import bone_channels

__all__ = ["Preview", "SceneState", "WorldFrame", "holds"]


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


def holds(scene: bpy.types.Scene, wanted: bpy.types.Object) -> bool:
    """Whether an object itself is in a scene, not another one of its name (a linked and a local one may share it)."""
    return scene.objects.get(wanted.name) == wanted or any(o == wanted for o in scene.objects)


class Preview:
    """Shows a pose on the character, and where it has moved things, while its take grows, without a key."""

    def __init__(self, armature: bpy.types.Object) -> None:
        self.armature, self.placement, self.mount = armature, Placement.of(armature), Mount.of(armature)

    def show(self, hips_world: Array, local_rotations: Array, moved: Iterable[tuple[bpy.types.Object, Matrix]] = ()) -> None:
        """Pose the character: hips (3,) world, Blender units, and rotations (23, 4) as in the core; put objects at world matrices."""
        rotations = quat_normalize(np.asarray(local_rotations, dtype=np.float64))[None]
        hips = np.asarray(hips_world, dtype=np.float64)[None]
        location, basis = bone_channels(self.armature, self.placement, self.mount, hips, rotations)
        for j, name in enumerate(JOINTS):
            place = Matrix.Translation(Vector(location[0])) if j == HIPS else Matrix()
            self.armature.pose.bones[name].matrix_basis = place @ Quaternion(basis[0, j]).to_matrix().to_4x4()
        for moving, world in moved:
            moving.matrix_world = world
