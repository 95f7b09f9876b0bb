"""Read BVH captures that are on the 23-joint skeleton."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .clip import Clip, resample
from .conventions import FPS
from .errors import CaptureError
from .rotations import quat_from_axis_angle, quat_mul, quat_normalize
from .skeleton import JOINTS, J, require_joints

_AXES = {"X": np.array((1.0, 0, 0)), "Y": np.array((0, 1.0, 0)), "Z": np.array((0, 0, 1.0))}


def read(path: str | Path, centimetres: bool = True) -> Clip:
    """Read a BVH file (Y up, facing +Z, rest pose a T-pose with identity rotations) as a Clip.

    Rotations are the product of the channels in their order; axes become Z up, facing -Y; the motion is
    resampled to 30 Hz.  Raises CaptureError with the line where the file breaks off or holds no numbers,
    and SkeletonError where joints are missing.
    """
    path = Path(path)
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise CaptureError(f"{path.name} cannot be read ({error.strerror}); check the path.") from error
    except UnicodeDecodeError as error:
        raise CaptureError(f"{path.name} holds bytes that are not text; it is damaged or not a BVH file.") from error
    channels: list[tuple[str, str]] = []
    stack: list[str] = []
    names: list[str] = []
    motion_line = None
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        if words[0] in ("ROOT", "JOINT"):
            if len(words) < 2:
                raise CaptureError(f"{path.name}, line {number}: a joint has no name; the file is damaged.")
            stack.append(words[1])
            names.append(words[1])
        elif words[0] == "End":
            stack.append("")
        elif words[0] == "}":
            if not stack:
                raise CaptureError(f"{path.name}, line {number}: a bracket closes that was never opened; the file is damaged.")
            stack.pop()
        elif words[0] == "CHANNELS":
            if not stack:
                raise CaptureError(f"{path.name}, line {number}: channels stand before any joint; the file is damaged.")
            channels += [(stack[-1], c) for c in words[2:]]
        elif words[0] == "MOTION":
            motion_line = number
            break
    if motion_line is None or not channels:
        raise CaptureError(f"{path.name}: no MOTION section was found; the file is truncated or not a BVH file.")
    require_joints(names, path.name)
    try:
        frames = int(lines[motion_line].split(":")[1])
        interval = float(lines[motion_line + 1].split(":")[1])
    except (IndexError, ValueError) as error:
        raise CaptureError(f"{path.name}, line {motion_line + 1}: expected 'Frames:' and 'Frame Time:'; the file is damaged.") from error
    if frames < 1 or not np.isfinite(interval) or interval <= 0:
        raise CaptureError(
            f"{path.name}, line {motion_line + 1}: {frames} frames of {interval:g} seconds are no motion; write both as positive numbers."
        )
    rows = [(number, line) for number, line in enumerate(lines[motion_line + 2 :], motion_line + 3) if line.strip()]
    if len(rows) < frames:
        raise CaptureError(
            f"{path.name}, line {rows[-1][0] if rows else motion_line + 2}: {frames} frames are announced, {len(rows)} are there."
        )
    values = np.empty((frames, len(channels)))
    for row, (number, line) in enumerate(rows[:frames]):
        try:
            values[row] = np.array(line.split(), dtype=float)
        except ValueError as error:
            raise CaptureError(f"{path.name}, line {number}: expected {len(channels)} numbers; the file is damaged.") from error
        if not np.isfinite(values[row]).all():
            raise CaptureError(f"{path.name}, line {number}: a value is not a number; repair or cut that frame.")

    hips = np.zeros((frames, 3))
    rotations = np.zeros((frames, J, 4))
    rotations[..., 0] = 1
    index = {n: i for i, n in enumerate(JOINTS)}
    for column, (joint, channel) in enumerate(channels):
        if joint not in index:
            continue
        axis, kind = channel[0].upper(), channel[1:]
        if kind == "position":
            if joint == JOINTS[0]:
                hips[:, "XYZ".index(axis)] = values[:, column]
        else:
            turn = quat_from_axis_angle(np.broadcast_to(_AXES[axis], (frames, 3)), np.radians(values[:, column]))
            rotations[:, index[joint]] = quat_mul(rotations[:, index[joint]], turn)
    # Y up, +Z forward to Z up, -Y forward: (x, y, z) -> (x, -z, y), for vectors and for rotation axes alike.
    hips = hips[:, (0, 2, 1)] * (1, -1, 1) * (0.01 if centimetres else 1.0)
    rotations = rotations[..., (0, 1, 3, 2)] * (1, 1, -1, 1)
    rate = 1 / interval
    if abs(rate - FPS) > 0.1:
        times = np.arange(int((frames - 1) * interval * FPS) + 1) / FPS
        hips, rotations = resample(hips, rotations, times, rate)
    return Clip(path.stem, hips.astype(np.float32), quat_normalize(rotations).astype(np.float32))
