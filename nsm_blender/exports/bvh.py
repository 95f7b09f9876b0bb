"""A take as BVH: the 23 joints at the character's own proportions, where it is in the world."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from nsm_core.data.captures.bvh_writer import write_bvh

from ..animation.kept import frame_kept
from ..animation.rate import scene_fps
from ..keys.keying import read_back
from ..rigs.armature import Placement


def export_bvh(path: Path, armature: bpy.types.Object, first: int, last: int, scene: bpy.types.Scene) -> None:
    """Write what ``armature`` does from frame ``first`` to ``last``, as the scene shows it, at its rate.

    The file is in centimetres by the scene's unit scale.  Raises OutputError where it cannot be written, and
    SkeletonError where the armature has lost its bones.
    """
    with frame_kept(scene):
        scene.frame_set(first)
        placement = Placement.of(armature)
        hips, local = read_back(armature, range(first, last + 1), scene)
    metre = scene.unit_settings.scale_length  # metres to a Blender unit
    offsets = placement.seen.offsets * placement.scale * metre
    write_bvh(path, hips * metre, local, scene_fps(scene), np.asarray(offsets))
