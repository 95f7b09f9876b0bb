"""Overlays in pictures: the viewport's arrays as meshes for Workbench, so that no graphics card is needed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..keys.keyed import KeyedTake
from ..outlook import Outlook
from ..pictures.camera import Shot, follow_camera
from ..pictures.outputs import PICTURE, require_writable, scratch_folder
from ..pictures.render import halved, join_tiles, read_png, render_still, write_png
from ..pictures.studio import studio
from .kept import RememberedTake, remembered_take
from .layers import LAYERS, Layer
from .scene_layers import followed
from .shapes import Colour, Shapes

_WIDTH, _FAR = 0.014, 2.2  # of a line, Blender units of a scene in metres; times that from afar
_STEPS = 12  # of every colour's red, green, blue and opacity: so many materials do for a picture


@contextlib.contextmanager
def as_meshes(scene: bpy.types.Scene, shapes: Sequence[Shapes], width: float) -> Iterator[None]:
    """Have overlays stand in ``scene`` as meshes of plain colours while pictures are made; lines are
    ``width`` wide.
    """
    made: list[bpy.types.Object] = []
    materials: list[bpy.types.Material] = []
    try:
        for colour, corners in _by_colour(shapes, width):
            mesh = bpy.data.meshes.new("NSM Overlay")
            mesh.from_pydata(corners.tolist(), [], np.arange(len(corners)).reshape(-1, 3).tolist())
            material = bpy.data.materials.new("NSM Overlay")
            material.diffuse_color = _linear(colour)
            mesh.materials.append(material)
            shown = bpy.data.objects.new("NSM Overlay", mesh)
            shown.display.show_shadows = False
            scene.collection.objects.link(shown)
            made.append(shown)
            materials.append(material)
        yield
    finally:
        for shown in made:
            mesh = shown.data
            bpy.data.objects.remove(shown)
            bpy.data.meshes.remove(mesh)
        for material in materials:
            bpy.data.materials.remove(material)


def paint(picture: Array, shapes: Shapes, scale: float, margin: int = 12) -> None:
    """Paint what lies flat on the screen into a picture (H, W, 4), bottom row first, in place; ``scale`` is
    pixels of the picture to one of the overlay.
    """
    height, width = picture.shape[:2]
    for corners, colour in zip(
        shapes.triangles.reshape(-1, 3, 3)[..., :2] * scale + margin,
        shapes.triangle_colours[::3],
        strict=True,
    ):
        low = np.maximum(np.floor(corners.min(0)).astype(int), 0)
        high = np.minimum(np.ceil(corners.max(0)).astype(int) + 1, (width, height))
        if (low >= high).any():
            continue
        x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
        inside = _inside(corners.astype(np.float64), x, y)
        region = picture[low[1] : high[1], low[0] : high[0], :3]
        region[inside] += float(colour[3]) * (colour[:3] - region[inside])


def _inside(corners: Array, x: Array, y: Array) -> Array:
    sides = []
    for k in range(3):
        (ax, ay), (bx, by) = corners[k], corners[(k + 1) % 3]
        sides.append((bx - ax) * (y - ay) - (by - ay) * (x - ax))
    # A point on a shared side belongs to one of two triangles.
    return np.all([s >= 0 for s in sides], axis=0) | np.all([s < 0 for s in sides], axis=0)


def _by_colour(shapes: Sequence[Shapes], width: float) -> Iterator[tuple[Array, Array]]:
    """Colours (4,) and the corners (3 T, 3) of all triangles in each."""
    corners = np.concatenate([np.zeros((0, 3), np.float32)] + [s.triangles for s in shapes])
    tones = np.concatenate([np.zeros((0, 4), np.float32)] + [s.triangle_colours[::3] for s in shapes])
    for s in shapes:
        sticks = _sticks(s.lines.reshape(-1, 2, 3), width)
        corners = np.concatenate((corners, sticks.reshape(-1, 3)))
        tones = np.concatenate((tones, np.repeat(s.line_colours[::2], 8, axis=0)))
    steps = np.round(tones * _STEPS).astype(np.int64)
    for step in np.unique(steps, axis=0) if len(steps) else ():
        chosen = (steps == step).all(1)
        yield step / _STEPS, corners.reshape(-1, 3, 3)[chosen].reshape(-1, 3)


def _sticks(lines: Array, width: float) -> Array:
    """Triangles (L * 8, 3, 3) of thin bars along lines (L, 2, 3)."""
    if not len(lines):
        return np.zeros((0, 3, 3), np.float32)
    along = lines[:, 1] - lines[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    other = np.where(np.abs(along[:, 2:]) > 0.9, np.array((1.0, 0, 0)), np.array((0, 0, 1.0)))
    u = np.cross(along, other)
    u *= width / 2 / np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-9)
    v = np.cross(along, u)
    ring = np.stack((u + v, u - v, -u - v, -u + v), 1)  # (L, 4, 3)
    low, high = lines[:, :1] + ring, lines[:, 1:] + ring
    following = (1, 2, 3, 0)
    sides = np.concatenate(
        (
            np.stack((low, low[:, following], high), 2),
            np.stack((low[:, following], high[:, following], high), 2),
        ),
        1,
    )
    return sides.reshape(-1, 3, 3)


def _linear(colour: Colour) -> tuple[float, ...]:
    """A colour of the screen as materials have it."""
    rgb = np.asarray(colour[:3], np.float64)
    out = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return (*out.tolist(), float(colour[3]))


@dataclass(frozen=True)
class View:
    """One tile of a sheet: overlays by their keys at a frame; ``whole`` shows the room from the scene's own
    camera, else one stays with the character.
    """

    keys: tuple[str, ...]
    frame: int
    whole: bool = False


def overlay_sheet(
    take: KeyedTake,
    path: str | Path,
    views: Sequence[View],
    before: Outlook | None = None,
    size: tuple[int, int] = (480, 330),
    columns: int = 2,
    direction: tuple[float, float, float] | None = None,
    scene: bpy.types.Scene | None = None,
) -> Path:
    """Render a take with overlays over it, a tile each view, into one PNG and return its path.

    ``before`` is what was seen before the take, for the overlays that show that.  ``direction`` is as for
    ``contact_sheet``.  The scene's own settings come back.  Raises OutputError when the file cannot be
    written.
    """
    scene = scene or bpy.context.scene
    path = require_writable(path, PICTURE, "The picture")
    shown, own = remembered_take(take.armature), scene.camera
    pictures = []
    with scratch_folder() as folder, studio(scene, (2 * size[0], 2 * size[1])) as temporary:
        frames = [view.frame for view in views]
        follow_camera(temporary.camera, take, scene, Shot(height=2.6), direction, frames)
        scene.render.image_settings.file_format = "PNG"
        for number, view in enumerate(views):
            scene.frame_set(view.frame)
            scene.camera = own if view.whole and own is not None else temporary.camera
            chosen = [layer for layer in LAYERS if layer.key in view.keys]
            made = {layer: _made(layer, before, shown, scene, view.frame) for layer in chosen}
            width = _WIDTH * (_FAR if view.whole else 1.0)
            with as_meshes(scene, [made[layer] for layer in chosen if not layer.flat], width):
                tile = folder / f"{number:03d}.png"
                scene.render.filepath = str(tile)
                render_still(tile, scene)
            picture = halved(read_png(tile))
            for shapes in (made[layer] for layer in chosen if layer.flat):
                paint(picture, shapes, 0.55)
            pictures.append(picture)
    write_png(path, join_tiles(pictures, columns))
    return path


def _made(
    layer: Layer,
    before: Outlook | None,
    shown: RememberedTake | None,
    scene: bpy.types.Scene,
    frame: int,
) -> Shapes:
    made = []
    if layer.before is not None and before is not None:
        made.append(followed(layer.before(before), before, scene) if layer.follows else layer.before(before))
    t = None if shown is None else shown.frame_at(frame)
    if layer.during is not None and shown is not None and t is not None:
        made.append(layer.during(shown, t))
    return Shapes().joined(made)
