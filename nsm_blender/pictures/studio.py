"""Set a scene up for pleasant Workbench pictures and put everything back afterwards."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TextIO

import bpy

BACKGROUND = (0.70, 0.73, 0.76)
# What the pictures change, by owner; the order matters where one choice opens the next.
_RENDER = (
    "engine", "resolution_x", "resolution_y", "resolution_percentage", "filepath", "film_transparent",
    "fps_base", "use_stamp", "use_border", "use_compositing", "use_sequencer", "use_file_extension",
    "use_overwrite",
)  # fmt: skip
_IMAGE = ("media_type", "file_format")
_FFMPEG = ("format", "codec")  # choosing these resets the other settings
_SHADING = (
    "light", "studio_light", "color_type", "show_cavity", "cavity_type", "show_shadows", "shadow_intensity",
    "show_specular_highlight", "show_object_outline", "curvature_ridge_factor", "curvature_valley_factor",
    "cavity_ridge_factor", "cavity_valley_factor", "use_world_space_lighting", "studiolight_rotate_z",
    "show_xray",
)  # fmt: skip
_DISPLAY = ("render_aa", "light_direction", "shadow_shift", "shadow_focus", "matcap_ssao_distance")
_VIEW = ("view_transform", "look", "exposure", "gamma")
_SCENE = ("camera", "world", "frame_start", "frame_end", "frame_step")


@dataclass
class Temporary:
    """What exists only while pictures are made."""

    camera: bpy.types.Object


@contextlib.contextmanager
def studio(scene: bpy.types.Scene, size: tuple[int, int], fast: bool = False) -> Iterator[Temporary]:
    """Make ``scene`` ready for Workbench pictures of ``size`` pixels with a camera of its own; restore it on
    leaving.

    ``fast`` leaves out what costs most without a graphics card, cast shadows (two thirds of a frame) and
    shading in corners.
    """
    owners = [
        (scene, _SCENE),
        (scene.render, _RENDER),
        (scene.render.image_settings, _all(scene.render.image_settings, _IMAGE)),
        (scene.render.ffmpeg, _all(scene.render.ffmpeg, _FFMPEG)),
        (scene.display.shading, _SHADING),
        (scene.display, _DISPLAY),
        (scene.view_settings, _VIEW),
    ]
    kept = [
        (owner, name, _value(owner, name))
        for owner, names in owners
        for name in names
        if hasattr(owner, name)
    ]
    frame = scene.frame_current, scene.frame_subframe
    data = bpy.data.cameras.new("NSM Picture")
    camera = bpy.data.objects.new("NSM Picture", data)
    scene.collection.objects.link(camera)
    world = bpy.data.worlds.new("NSM Picture")
    world.color = BACKGROUND
    try:
        scene.camera, scene.world = camera, world
        _set_up(scene, size, fast)
        yield Temporary(camera)
    finally:
        for owner, name, value in kept:
            # A value that its owner no longer offers (a codec of another container) is left as it is.
            with contextlib.suppress(TypeError, ValueError, AttributeError):
                setattr(owner, name, value)
        action = camera.animation_data.action if camera.animation_data else None
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)
        bpy.data.worlds.remove(world)
        if action:
            bpy.data.actions.remove(action)
        scene.frame_set(frame[0], subframe=frame[1])


def _set_up(scene: bpy.types.Scene, size: tuple[int, int], fast: bool) -> None:
    render, shading, display, view = scene.render, scene.display.shading, scene.display, scene.view_settings
    render.engine = "BLENDER_WORKBENCH"
    render.resolution_x, render.resolution_y, render.resolution_percentage = (
        size[0] // 2 * 2,
        size[1] // 2 * 2,
        100,
    )
    render.film_transparent = render.use_stamp = render.use_border = False
    render.use_compositing = render.use_sequencer = False
    render.use_file_extension = render.use_overwrite = True
    shading.light, shading.color_type = "STUDIO", "MATERIAL"
    with contextlib.suppress(TypeError):  # a build without this light keeps its default
        shading.studio_light = "paint.sl"
    shading.show_cavity, shading.cavity_type = True, "SCREEN" if fast else "BOTH"
    shading.cavity_ridge_factor, shading.cavity_valley_factor = 0.5, 1.2
    shading.curvature_ridge_factor, shading.curvature_valley_factor = 0.7, 0.8
    shading.show_shadows, shading.shadow_intensity = not fast, 0.35
    shading.show_specular_highlight, shading.show_object_outline, shading.show_xray = True, False, False
    display.light_direction = (0.30, 0.42, 0.85)
    display.shadow_focus = 0.3
    display.matcap_ssao_distance = 0.35
    display.render_aa = "FXAA" if fast else "OFF"
    # The neutral transform keeps the materials' own colours; every version offers it.
    view.view_transform, view.look, view.exposure, view.gamma = "Standard", "None", 0.0, 1.0


def _all(owner: Any, first: tuple[str, ...]) -> list[str]:
    """Every plain setting of ``owner``, those in ``first`` before the others."""
    plain = [
        p.identifier
        for p in owner.bl_rna.properties
        if p.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"} and not p.is_readonly
    ]
    return [*first, *(name for name in plain if name not in first)]


def _value(owner: Any, name: str) -> Any:
    value = getattr(owner, name)
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


# What a driver without a graphics card says at every start although nothing is wrong.
_HARMLESS = ("EGL Error", "EGL_BAD_MATCH", "libEGL warning", "MESA: error: ZINK", "MESA-LOADER")


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep the renderer's own lines and the driver's harmless ones off the terminal; Python's prints and
    errors still arrive.
    """
    with _held(sys.stdout, 1), _held(sys.stderr, 2):
        yield


@contextlib.contextmanager
def _held(stream: TextIO, number: int) -> Iterator[None]:
    """Hold what is written to file descriptor ``number`` past Python; of the error stream, all but harmless
    lines comes after.
    """
    try:
        fileno = stream.fileno()
    except (OSError, AttributeError, ValueError):
        fileno = None
    if fileno != number:  # captured or redirected already: leave it alone
        yield
        return
    stream.flush()
    kept = os.dup(number)
    redirect = contextlib.redirect_stdout if number == 1 else contextlib.redirect_stderr
    with tempfile.TemporaryFile() as said:
        try:
            with os.fdopen(os.dup(kept), "w", buffering=1) as python_out, redirect(python_out):
                os.dup2(said.fileno(), number)
                yield
        finally:
            os.dup2(kept, number)
            os.close(kept)
            said.seek(0)
            if number == 2:
                lines = said.read().decode(errors="replace").splitlines(keepends=True)
                stream.writelines(line for line in lines if not any(word in line for word in _HARMLESS))
