"""Pictures of a take without a graphics card: a contact sheet and a video, by Workbench."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
import numpy as np

from nsm_core.errors import OutputError
from nsm_core.rotations import Array

from ..keys.keyed import KeyedTake
from .camera import Shot, follow_camera
from .labels import stamp
from .outputs import FILM, PICTURE, mp4_is_whole, png_is_whole, require_writable, scratch_folder, written
from .studio import quiet, studio

Progress = Callable[[float], None]


def contact_sheet(
    take: KeyedTake,
    path: str | Path,
    tiles: int = 15,
    columns: int = 5,
    size: tuple[int, int] = (320, 270),
    direction: tuple[float, float, float] | None = None,
    numbers: bool = True,
    scene: bpy.types.Scene | None = None,
    progress: Progress | None = None,
    frames: Sequence[int] | None = None,
) -> Path:
    """Render frames of a take, evenly spaced or those in ``frames``, side by side into one PNG and return its
    path.

    The camera stays with the character and looks from ``direction`` (from the character towards the camera)
    or, where something stands there, from a side where it is seen.  ``size`` is of a tile, pixels;
    ``numbers`` writes the time into each.  ``progress`` hears 0..1.  The scene's own settings come back.
    Raises OutputError when the file cannot be written.
    """
    scene = scene or bpy.context.scene
    path = require_writable(path, PICTURE, "The picture")
    if frames is None:
        frames = np.unique(np.linspace(take.first, take.last, tiles).round().astype(int))
    pictures = []
    # Twice as large and halved: smooth edges for half of what the renderer's own samples cost without a
    # graphics card.
    with scratch_folder() as folder, studio(scene, (2 * size[0], 2 * size[1])) as temporary:
        follow_camera(temporary.camera, take, scene, Shot(height=2.3), direction, frames)
        scene.render.image_settings.file_format = "PNG"
        for k, frame in enumerate(frames):
            scene.frame_set(int(frame))
            tile = folder / f"{frame:06d}.png"
            scene.render.filepath = str(tile)
            render_still(tile, scene)
            picture = halved(read_png(tile))
            if numbers:
                stamp(
                    picture,
                    f"{(frame - take.first) / take.fps:.1f}s",
                    size=max(1, picture.shape[0] // 90),
                )
            pictures.append(picture)
            if progress:
                progress((k + 1) / len(frames))
    write_png(path, join_tiles(pictures, columns))
    return path


def video(
    take: KeyedTake,
    path: str | Path,
    size: tuple[int, int] = (640, 360),
    step: int = 1,
    direction: tuple[float, float, float] | None = None,
    scene: bpy.types.Scene | None = None,
    progress: Progress | None = None,
) -> Path:
    """Render a take as an H.264 MP4 at the scene's own speed and return its path.

    ``step`` renders every so many frames only; the rest as for ``contact_sheet``.  Raises OutputError when
    the file cannot be written.
    """
    scene = scene or bpy.context.scene
    path = require_writable(path, FILM, "The video")
    heard = []

    def hear(*_: object) -> None:
        heard.append(0)
        if progress:
            progress(min(len(heard) / max(1, len(range(take.first, take.last + 1, step))), 1.0))

    with scratch_folder() as folder, studio(scene, size, fast=True) as temporary:
        follow_camera(
            temporary.camera, take, scene, Shot(height=2.35, tracking=0.85, softness=0.6), direction
        )
        use_mp4(scene)
        scene.frame_start, scene.frame_end, scene.frame_step = take.frame_start, take.frame_end, step
        scene.render.fps_base *= step
        scene.render.filepath = str(folder / "take.mp4")
        bpy.app.handlers.render_post.append(hear)
        try:
            _render(folder / "take.mp4", mp4_is_whole, animation=True, scene=scene.name)
        finally:
            bpy.app.handlers.render_post.remove(hear)
        with written(path, "The video", mp4_is_whole) as beside:
            shutil.copyfile(folder / "take.mp4", beside)
    return path


def use_mp4(scene: bpy.types.Scene) -> None:
    """Choose H.264 in MP4 as the scene's output."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # 5.0 on: FFMPEG is not offered among the picture formats
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    ffmpeg = scene.render.ffmpeg
    ffmpeg.format, ffmpeg.codec = "MPEG4", "H264"
    ffmpeg.constant_rate_factor, ffmpeg.ffmpeg_preset = "HIGH", "GOOD"
    ffmpeg.audio_codec = "NONE"


def render_still(made: Path, scene: bpy.types.Scene) -> None:
    """Render the current frame to the scene's output path, which is ``made``; OutputError where that
    fails.
    """
    _render(made, png_is_whole, write_still=True, scene=scene.name)


def _render(made: Path, is_whole: Callable[[Path], bool], **how: str | bool) -> None:
    """Render to a temporary file; OutputError where it is not there or, since Blender is silent about that,
    cut short.
    """
    reason = ""
    try:
        with quiet():
            bpy.ops.render.render(**how)
    except RuntimeError as problem:
        reason = f" (Blender says: {str(problem).removeprefix('Error: ').strip()})"
    if reason or (made.exists() and not is_whole(made)):
        raise OutputError(
            f"Rendering into {made.parent} was cut short{reason}; the disk may be full: make room there."
        )
    if not made.exists():
        raise OutputError(
            f"This Blender wrote no {made.suffix}; make room in {made.parent.parent}, or use a build with "
            "FFmpeg."
        )


def read_png(path: Path) -> Array:
    """Pixels (H, W, 4) of a picture file, 0..1, bottom row first as Blender has them."""
    image = bpy.data.images.load(str(path), check_existing=False)
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def halved(pixels: Array) -> Array:
    """Mean (H, W, 4) of each two by two of pixels (2 H, 2 W, 4)."""
    height, width = pixels.shape[0] // 2, pixels.shape[1] // 2
    return pixels[: 2 * height, : 2 * width].reshape(height, 2, width, 2, -1).mean((1, 3), dtype=np.float32)


def write_png(path: Path, pixels: Array) -> None:
    """Save pixels (H, W, 4), 0..1, bottom row first; OutputError when that fails."""
    image = bpy.data.images.new(path.stem, pixels.shape[1], pixels.shape[0], alpha=True)
    try:
        image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
        with written(path, "The picture", png_is_whole) as beside:
            image.filepath_raw, image.file_format = str(beside), "PNG"
            image.save()
    finally:
        bpy.data.images.remove(image)


def join_tiles(pictures: list[Array], columns: int, gap: int = 4) -> Array:
    """Lay pictures (H, W, 4) out in rows from the top left, with a light gap between them."""
    height, width = pictures[0].shape[:2]
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    sheet = np.ones((rows * (height + gap) - gap, columns * (width + gap) - gap, 4), np.float32)
    for k, picture in enumerate(pictures):
        row, column = divmod(k, columns)
        bottom = (rows - 1 - row) * (height + gap)
        sheet[bottom : bottom + height, column * (width + gap) : column * (width + gap) + width] = picture
    return sheet
