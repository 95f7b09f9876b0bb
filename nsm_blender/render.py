"""Pictures of a take without a graphics card: a contact sheet and a video, by Workbench."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
import numpy as np

from nsm_core.errors import OutputError
from nsm_core.rotations import Array

from .camera import Shot, follow_camera
from .keying import KeyedTake
from .labels import stamp
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
    """Render frames of a take, evenly spaced or those in ``frames``, side by side into one PNG and return its path.

    The camera stays with the character and looks from ``direction`` (from the character towards the camera) or, where
    something stands there, from a side where it is seen.  ``size`` is of a tile, pixels; ``numbers`` writes the time into
    each.  ``progress`` hears 0..1.
    The scene's own settings come back.  Raises OutputError when the file cannot be written.
    """
    scene = scene or bpy.context.scene
    path = require_writable(path, ".png")
    if frames is None:
        frames = np.unique(np.linspace(take.frame_start, take.frame_end, tiles).round().astype(int))
    pictures = []
    # Twice as large and halved: smooth edges for half of what the renderer's own samples cost without a graphics card.
    with tempfile.TemporaryDirectory() as folder, studio(scene, (2 * size[0], 2 * size[1])) as temporary:
        follow_camera(temporary.camera, take, scene, Shot(height=2.3), direction, frames)
        scene.render.image_settings.file_format = "PNG"
        for k, frame in enumerate(frames):
            scene.frame_set(int(frame))
            tile = Path(folder) / f"{frame:06d}.png"
            scene.render.filepath = str(tile)
            with quiet():
                bpy.ops.render.render(write_still=True, scene=scene.name)
            picture = halved(read_png(tile))
            if numbers:
                stamp(picture, f"{(frame - take.frame_start) / take.fps:.1f}s", size=max(1, picture.shape[0] // 90))
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

    ``step`` renders every so many frames only; the rest as for ``contact_sheet``.  Raises OutputError when the file
    cannot be written.
    """
    scene = scene or bpy.context.scene
    path = require_writable(path, ".mp4")
    heard = []

    def hear(*_: object) -> None:
        heard.append(0)
        if progress:
            progress(min(len(heard) / max(1, len(range(take.frame_start, take.frame_end + 1, step))), 1.0))

    with tempfile.TemporaryDirectory() as folder, studio(scene, size, fast=True) as temporary:
        follow_camera(temporary.camera, take, scene, Shot(height=2.35, tracking=0.85, softness=0.6), direction)
        use_mp4(scene)
        scene.frame_start, scene.frame_end, scene.frame_step = take.frame_start, take.frame_end, step
        scene.render.fps_base *= step
        scene.render.filepath = str(Path(folder) / "take.mp4")
        bpy.app.handlers.render_post.append(hear)
        try:
            with quiet():
                bpy.ops.render.render(animation=True, scene=scene.name)
        finally:
            bpy.app.handlers.render_post.remove(hear)
        made = sorted(Path(folder).glob("*.mp4"))
        if not made:
            raise OutputError("This Blender could not write an MP4; ask for a sheet instead, or use a build with FFmpeg.")
        try:
            shutil.copyfile(made[0], path)
        except OSError as error:
            raise OutputError(f"The video cannot be written to {path} ({error.strerror}); choose another folder or file name.") from error
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


def require_writable(path: str | Path, suffix: str) -> Path:
    """Return ``path`` with ``suffix``, its folder made; OutputError when a file cannot be written there."""
    path = Path(bpy.path.abspath(str(path))).absolute()
    if path.suffix.lower() != suffix:
        path = path.with_name(path.name + suffix)
    existed = path.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab"):
            pass
        if not existed:
            path.unlink()
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}); choose another folder or file name.") from error
    return path


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
        image.filepath_raw, image.file_format = str(path), "PNG"
        image.save()
    except RuntimeError as error:
        raise OutputError(f"The picture cannot be written to {path}; choose another folder or file name.") from error
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
