"""A camera that stays with a character: far enough away, moving softly, from where it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.rotations import Array

from ..animation.channels import assign, new_action
from ..keys.keyed import KeyedTake
from ..prepare import own_objects
from ..rigs.bone_map import bone_map_of
from ..world.frame import WorldFrame
from .viewpoint import choose_views, soften

_ADULT = 1.75  # metres
_TALLER = 1.05  # times as tall as its legs let expect that a body is looked at as such
LENS, SENSOR = 45.0, 36.0  # millimetres
_BODY = 0.9  # metres before the middle of the body that belong to it when what is in front is cut away


@dataclass(frozen=True)
class Shot:
    """How a camera follows a take.

    ``height`` of the world that fits in the picture at the character, metres of an adult; ``tracking`` 0
    holds the middle of the path, 1 stays with the hips; ``softness`` in seconds smooths the camera's way.
    """

    height: float
    tracking: float = 1.0
    softness: float = 0.0


def follow_camera(
    camera: bpy.types.Object,
    take: KeyedTake,
    scene: bpy.types.Scene,
    shot: Shot,
    wish: Sequence[float] | None = None,
    frames: Sequence[int] | None = None,
) -> None:
    """Key ``camera`` so that it follows the take as ``shot`` says, seeing it; call with the render size
    already set.

    ``wish`` (3,) and ``frames`` are those of ``choose_views``.
    """
    frame = WorldFrame.of(take.armature)
    hips, facing = path_of(take, scene)
    size = _size(take, frame, scene)
    picture_height = SENSOR * scene.render.resolution_y / scene.render.resolution_x
    distance = shot.height * size * LENS / picture_height
    targets = soften(hips, shot.softness * take.fps)
    targets = shot.tracking * targets + (1 - shot.tracking) * (hips.min(0) + hips.max(0)) / 2
    # A camera at the middle of the body: level, but that it rises with who stands on something.
    targets[:, 2] = np.maximum(targets[:, 2] - 0.16 * size, frame.floor + 0.86 * size)
    views = choose_views(take, scene, targets, facing, distance, wish, frames)
    data = camera.data
    data.lens, data.sensor_width, data.sensor_fit = LENS * views.nearness, SENSOR, "HORIZONTAL"
    distance *= views.nearness
    data.clip_end = 200 * distance
    data.clip_start = distance - _BODY * size if views.cutaway else 0.01 * distance
    camera.rotation_mode = "QUATERNION"
    turns = [(-Vector(d)).to_track_quat("-Z", "Y") for d in views.directions]
    for last, turn in zip(turns[:-1], turns[1:], strict=True):
        turn.make_compatible(last)
    channels = new_action("NSM Picture", camera.name)
    at = np.arange(take.first, take.last + 1)
    for path, values in (
        ("location", targets + views.directions * distance),
        ("rotation_quaternion", np.array(turns)),
    ):
        for i in range(values.shape[1]):
            channels.curve(path, i, "Camera", at, values[:, i])
    assign(camera, channels.action, channels.slot)


def _size(take: KeyedTake, frame: WorldFrame, scene: bpy.types.Scene) -> float:
    """Blender units to a metre of an adult as tall as the character: that of its frame, which goes by the
    legs, but where a large head or body rises high over short ones.
    """
    depsgraph, tops = bpy.context.evaluated_depsgraph_get(), [0.0]
    for own in own_objects(take.armature, scene):
        if own.type == "MESH":
            shown = own.evaluated_get(depsgraph)
            tops += [(shown.matrix_world @ Vector(corner)).z - frame.floor for corner in shown.bound_box]
    tall = max(tops) / _ADULT
    return tall if tall > _TALLER * frame.scale else frame.scale


def path_of(take: KeyedTake, scene: bpy.types.Scene) -> tuple[Array, Array]:
    """Hips (N, 3), world, Blender units, and facing directions (N, 2) at every frame of a take, from its
    keys.
    """
    hips, facing = [], []
    seen = bone_map_of(take.armature)
    kept = scene.frame_current, scene.frame_subframe
    for number in range(take.first, take.last + 1):
        scene.frame_set(number)
        matrix, bones = take.armature.matrix_world, take.armature.pose.bones
        hips.append(tuple(matrix @ bones[seen.seen("Hips")].head))
        right_hip, left_hip = (bones[seen.seen(f"{side}Hip")].head for side in ("Right", "Left"))
        left = matrix.to_3x3() @ (left_hip - right_hip)
        facing.append(tuple(Vector((left.y, -left.x)).normalized()))
    scene.frame_set(kept[0], subframe=kept[1])
    return np.array(hips), np.array(facing)
