"""Where to look at a take from: the clearest side, far enough away, moving softly with the character."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.rotations import Array

from .channels import assign, new_action
from .keying import KeyedTake

LENS, SENSOR = 45.0, 36.0  # millimetres
_ELEVATION = np.radians(20)
_SIDES, _FIRST_SIDE = 12, -np.pi / 3


@dataclass
class Shot:
    """How a camera follows a take.

    ``hips`` (N, 3) world, per frame; ``direction`` (3,) from the character to the camera; ``height`` of the world that
    fits in the picture at the character, metres; ``tracking`` 0 holds the middle of the path, 1 stays with the hips;
    ``softness`` in seconds smooths the camera's way.
    """

    hips: Array
    direction: tuple[float, float, float]
    height: float
    tracking: float
    softness: float = 0.0


def path_of(take: KeyedTake, scene: bpy.types.Scene) -> tuple[Array, Array]:
    """Hips (N, 3), world metres, and facing directions (N, 2) at every frame of a take, from its keys."""
    matrix, bones = take.armature.matrix_world, take.armature.pose.bones
    kept = scene.frame_current, scene.frame_subframe
    hips, facing = [], []
    for frame in range(take.frame_start, take.frame_end + 1):
        scene.frame_set(frame)
        hips.append(tuple(matrix @ bones["Hips"].head))
        left = matrix.to_3x3() @ (bones["LeftHip"].head - bones["RightHip"].head)
        facing.append(tuple(Vector((left.y, -left.x)).normalized()))
    scene.frame_set(kept[0], subframe=kept[1])
    return np.array(hips), np.array(facing)


def follow_camera(camera: bpy.types.Object, take: KeyedTake, shot: Shot) -> None:
    """Key ``camera`` so that it follows the take as ``shot`` says; call with the render size already set."""
    render = camera.users_scene[0].render
    camera.data.lens, camera.data.sensor_width, camera.data.sensor_fit = LENS, SENSOR, "HORIZONTAL"
    camera.data.clip_end = 1000
    picture_height = SENSOR * render.resolution_y / render.resolution_x
    distance = shot.height * LENS / picture_height
    direction = Vector(shot.direction).normalized()
    scale = float(np.clip(take.armature.matrix_world.median_scale, 1e-3, None))
    targets = _soften(shot.hips, shot.softness * take.fps)
    targets = shot.tracking * targets + (1 - shot.tracking) * (shot.hips.min(0) + shot.hips.max(0)) / 2
    floor = take.armature.matrix_world.translation.z
    # A camera at the middle of the body: level, but that it rises with who stands on something.
    targets[:, 2] = np.maximum(targets[:, 2] - 0.16 * scale, floor + 0.86 * scale)
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = (-direction).to_track_quat("-Z", "Y")
    channels = new_action("NSM Picture", camera.name)
    frames = np.arange(take.frame_start, take.frame_end + 1)
    places = targets + np.array(direction) * distance
    for i in range(3):
        channels.curve("location", i, "Camera", frames, places[:, i])
    assign(camera, channels.action, channels.slot)


def choose_direction(take: KeyedTake, scene: bpy.types.Scene, hips: Array, facing: Array) -> tuple[float, float, float]:
    """Pick the side (3,) from which the character is seen best: not hidden, and rather half from the front.

    ``hips`` (N, 3) and ``facing`` (N, 2) are the take's path.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    own = {take.armature.name, *(c.name for c in take.armature.children_recursive)}
    picks = np.linspace(0, len(hips) - 1, 9).astype(int)
    best, best_score = (0.6, -1.0, 0.5), -np.inf
    for azimuth in _FIRST_SIDE + np.arange(_SIDES) * (2 * np.pi / _SIDES):
        direction = np.array((np.cos(_ELEVATION) * np.cos(azimuth), np.cos(_ELEVATION) * np.sin(azimuth), np.sin(_ELEVATION)))
        clear = np.mean([_is_clear(scene, depsgraph, hips[k], direction, own) for k in picks])
        fronts = facing[picks] @ direction[:2]
        score = 3 * clear - 0.4 * np.mean(np.abs(fronts - 0.6)) - 0.4 * abs(fronts[-1] - 0.6)
        if score > best_score + 1e-9:
            best, best_score = tuple(float(v) for v in direction), score
    return best


def _is_clear(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, target: Array, direction: Array, own: set[str]) -> bool:
    """Whether nothing but the character lies between its hips and a camera 5 m away."""
    origin, end = Vector(target), Vector(target + direction * 5)
    step = (end - origin).normalized()
    for _ in range(8):
        hit, place, _, _, found, _ = scene.ray_cast(depsgraph, origin, step, distance=(end - origin).length)
        if not hit:
            return True
        if found.name not in own:
            return False
        origin = place + step * 1e-3
    return True


def _soften(path: Array, frames: float) -> Array:
    """Low-pass a path (N, 3) by a bell of ``frames`` standard deviation, ends held."""
    width = round(frames)
    if width < 1:
        return path.copy()
    kernel = np.exp(-0.5 * (np.arange(-2 * width, 2 * width + 1) / width) ** 2)
    padded = np.concatenate((np.repeat(path[:1], 2 * width, 0), path, np.repeat(path[-1:], 2 * width, 0)))
    return np.stack([np.convolve(padded[:, i], kernel / kernel.sum(), "valid") for i in range(3)], axis=-1)
