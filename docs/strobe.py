"""One picture of a motion: the character at several frames beside each other, each in a colour of its own."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import numpy as np
from mathutils import Matrix, Vector

from nsm_blender.pictures.render import read_png, render_still, write_png
from nsm_blender.pictures.studio import studio

KEYED, MADE = (0.78, 0.12, 0.55, 1.0), (0.25, 0.62, 0.25, 1.0)
_SHADES = 15  # of each colour besides none: a third of the bytes


def figures(
    character: bpy.types.Object, frames: Sequence[tuple[int, tuple[float, ...]]], apart: float, row: float
) -> list[bpy.types.Object]:
    """Copies of a character's body as it is at each of ``frames``, in a colour each, a step of ``apart``
    metres along x from one to the next however far it goes, and ``row`` metres along y.
    """
    scene, made = bpy.context.scene, []
    for number, (frame, colour) in enumerate(frames):
        scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        paint = bpy.data.materials.new("Paint")
        paint.diffuse_color = colour
        hips = character.matrix_world @ character.pose.bones["Hips"].head
        for body in (child for child in character.children_recursive if child.type == "MESH"):
            shown = body.evaluated_get(depsgraph)
            mesh = bpy.data.meshes.new_from_object(shown, depsgraph=depsgraph)
            mesh.materials.clear()
            mesh.materials.append(paint)
            copy = bpy.data.objects.new("Figure", mesh)
            aside = Vector((number * apart - hips.x, row - hips.y, 0.0))
            copy.matrix_world = Matrix.Translation(aside) @ shown.matrix_world
            made.append(copy)
    for copy in made:
        scene.collection.objects.link(copy)
    for body in character.children_recursive:
        body.hide_render = True
    return made


def picture(path: Path, size: tuple[int, int], middle: Sequence[float], wide: float, tilt: float) -> None:
    """A picture of the scene from its side, ``wide`` metres of it around a point; ``tilt`` radians down."""
    scene = bpy.context.scene
    with studio(scene, size, fast=True) as made:
        camera = made.camera
        camera.data.type, camera.data.ortho_scale = "ORTHO", wide
        away = Vector((0.0, -np.cos(tilt), np.sin(tilt))) * 20
        camera.location = Vector(middle) + away
        camera.rotation_euler = (-away).to_track_quat("-Z", "Y").to_euler()
        camera.data.clip_end = 100.0
        scene.render.image_settings.file_format = "PNG"
        scene.render.filepath = str(path)
        render_still(path, scene)
    write(path, read_png(path))


def write(path: Path, pixels: np.ndarray) -> None:
    """Save pixels (H, W, 4) in few shades."""
    write_png(path, np.round(pixels * _SHADES) / _SHADES)
