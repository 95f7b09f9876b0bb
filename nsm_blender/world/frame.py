"""The character's place and size in a scene: the core's world as it sees it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..rigs.armature import Placement


@dataclass(frozen=True)
class WorldFrame:
    """The core's world as one character sees it: its own metres, of which its hips are as high as the
    skeleton's; its floor at zero.

    ``scale`` is Blender units to such a metre, whatever the units of scene, object and bones are; ``floor`` a
    height, Blender units.
    """

    scale: float = 1.0
    floor: float = 0.0

    @classmethod
    def of(cls, armature: bpy.types.Object) -> WorldFrame:
        """Frame of a character: the size of its skeleton and its armature's height; SkeletonError as for
        ``Placement.of``.
        """
        placement = Placement.of(armature)
        return cls(placement.scale, float(placement.matrix[2, 3]))

    def to_core(self, points: Array) -> Array:
        """World points (..., 3), Blender units, in the core's frame."""
        return (np.asarray(points) - np.array((0, 0, self.floor))) / self.scale

    def to_world(self, points: Array) -> Array:
        """Core points (..., 3) in the world, Blender units."""
        return np.asarray(points, dtype=np.float64) * self.scale + np.array((0, 0, self.floor))


def holds(scene: bpy.types.Scene, wanted: bpy.types.Object) -> bool:
    """Whether an object itself is in a scene, not another one of its name (a linked and a local one may share
    it).
    """
    return scene.objects.get(wanted.name) == wanted or any(o == wanted for o in scene.objects)
