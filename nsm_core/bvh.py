"""Read BVH captures: files of the 23-joint skeleton as they are, any other hierarchy through a mapping onto it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from . import bvh_retarget
from .bvh_mapping import Mapping, guess_mapping
from .clip import Clip, resample
from .conventions import FPS
from .errors import CaptureError
from .rotations import Array, quat_from_axis_angle, quat_mul, quat_normalize, quat_rotate
from .skeleton import JOINTS, OFFSETS, PARENTS

_AXES = {"X": np.array((1.0, 0, 0)), "Y": np.array((0, 1.0, 0)), "Z": np.array((0, 0, 1.0))}
_OWN_TOLERANCE = 0.015  # metres that an offset may differ from the 23-joint skeleton's for the file to count as being on it


@dataclass(frozen=True)
class Bvh:
    """A BVH file as it is written: its own names, axes, units and rate.

    ``offsets`` (N, 3) and ``places`` (T, N, 3) are relative to the parent, in the file's units; ``rotations`` (T, N, 4) are
    relative to the parent; ``interval`` is the time between frames, seconds.  End sites are joints named after their
    parent with "_End" behind it.
    """

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    places: Array
    rotations: Array
    interval: float

    def __len__(self) -> int:
        return len(self.rotations)

    def world(self) -> tuple[Array, Array]:
        """World positions (T, N, 3) and rotations (T, N, 4) of all joints, in the file's axes and units."""
        return world_of(self.parents, self.places, self.rotations)

    def rest(self) -> tuple[Array, Array]:
        """World positions (N, 3) and rotations (N, 4) with every channel at zero."""
        identity = np.tile(np.array((1.0, 0, 0, 0)), (len(self.joints), 1))
        return world_of(self.parents, self.offsets, identity)

    def at_rate(self, fps: float = FPS) -> Bvh:
        """Return the motion at ``fps``; unchanged where the file is at that rate already."""
        rate = 1 / self.interval
        if abs(rate - fps) <= 0.1:
            return self
        times = np.arange(int((len(self) - 1) * self.interval * fps) + 1) / fps
        flat, rotations = resample(self.places.reshape(len(self), -1), self.rotations, times, rate)
        return replace(self, places=flat.reshape(len(times), -1, 3), rotations=rotations, interval=1 / fps)


def world_of(parents: tuple[int, ...], places: Array, rotations: Array) -> tuple[Array, Array]:
    """Chain (..., N, 3) places and (..., N, 4) rotations relative to parents into world ones of the same shapes."""
    positions, turned = np.empty_like(places), np.empty_like(rotations)
    for j, p in enumerate(parents):
        if p < 0:
            positions[..., j, :], turned[..., j, :] = places[..., j, :], rotations[..., j, :]
            continue
        turned[..., j, :] = quat_mul(turned[..., p, :], rotations[..., j, :])
        positions[..., j, :] = positions[..., p, :] + quat_rotate(turned[..., p, :], places[..., j, :])
    return positions, turned


def read(path: str | Path, centimetres: bool = True, mapping: Mapping | None = None) -> Clip:
    """Read a BVH file as a Clip: metres, Z up, facing -Y, 30 Hz.

    A file on the 23-joint skeleton (its names, its offsets, Y up, facing +Z) is taken as it is, in centimetres or else in
    metres.  Every other hierarchy is retargeted by ``mapping``, or by one guessed from the names of its joints.
    Raises CaptureError with the line where the file breaks off or holds no numbers, and SkeletonError where joints
    stand for none of the 23.
    """
    source = parse(path)
    if mapping is None and _is_own(source, 0.01 if centimetres else 1.0):
        return _as_it_is(source.at_rate(), 0.01 if centimetres else 1.0)
    return bvh_retarget.retarget(source, mapping or guess_mapping(source))


def _is_own(source: Bvh, unit: float) -> bool:
    """Whether the file is on the 23-joint skeleton: its names, and its offsets or none at all."""
    if not set(JOINTS) <= set(source.joints):
        return False
    found = [source.joints.index(n) for n in JOINTS[1:]]
    offsets = source.offsets[found][:, (0, 2, 1)] * (1, -1, 1) * unit
    if not offsets.any():
        return True
    own = [source.joints.index(JOINTS[p]) for p in PARENTS[1:]] == [source.parents[k] for k in found]
    return own and bool(np.abs(offsets - OFFSETS[1:]).max() < _OWN_TOLERANCE)


def _as_it_is(source: Bvh, unit: float) -> Clip:
    found = [source.joints.index(n) for n in JOINTS]
    # Y up, +Z forward to Z up, -Y forward: (x, y, z) -> (x, -z, y), for vectors and for rotation axes alike.
    hips = source.places[:, found[0]][:, (0, 2, 1)] * (1, -1, 1) * unit
    rotations = source.rotations[:, found][..., (0, 1, 3, 2)] * (1, 1, -1, 1)
    return Clip(source.name, hips.astype(np.float32), quat_normalize(rotations).astype(np.float32))


def parse(path: str | Path) -> Bvh:
    """Read a BVH file without changing anything; CaptureError names the line where it is damaged."""
    path = Path(path)
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise CaptureError(f"{path.name} cannot be read ({error.strerror}); check the path.") from error
    except UnicodeDecodeError as error:
        raise CaptureError(f"{path.name} holds bytes that are not text; it is damaged or not a BVH file.") from error
    names, parents, offsets, channels, motion = _hierarchy(path.name, lines)
    frames, interval = _head(path.name, lines, motion)
    values = _rows(path.name, lines, motion, frames, len(channels))
    places = np.tile(offsets, (frames, 1, 1))
    rotations = np.zeros((frames, len(names), 4))
    rotations[..., 0] = 1
    for column, (joint, axis, kind) in enumerate(channels):
        if kind == "position":  # the place that is written replaces the offset, as most programs have it
            places[:, joint, "XYZ".index(axis)] = values[:, column]
        else:
            turn = quat_from_axis_angle(np.broadcast_to(_AXES[axis], (frames, 3)), np.radians(values[:, column]))
            rotations[:, joint] = quat_mul(rotations[:, joint], turn)
    return Bvh(path.stem, tuple(names), tuple(parents), offsets, places, rotations, interval)


def _hierarchy(name: str, lines: list[str]) -> tuple[list[str], list[int], Array, list[tuple[int, str, str]], int]:
    """Names, parents, offsets (N, 3), channels (joint, axis, kind) and the line number of MOTION."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[tuple[int, str, str]] = []
    stack: list[int] = []
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        where, key = f"{name}, line {number}", words[0].upper()
        if key in ("ROOT", "JOINT", "END"):
            if len(words) < 2:
                raise CaptureError(f"{where}: a joint has no name; the file is damaged.")
            if key == "END" and not stack:
                raise CaptureError(f"{where}: an end stands before any joint; the file is damaged.")
            parents.append(stack[-1] if stack else -1)
            stack.append(len(names))
            names.append(f"{names[parents[-1]]}_End" if key == "END" else " ".join(words[1:]))
            offsets.append([0.0, 0.0, 0.0])
        elif key == "}":
            if not stack:
                raise CaptureError(f"{where}: a bracket closes that was never opened; the file is damaged.")
            stack.pop()
        elif key == "OFFSET" and stack:
            try:
                offsets[stack[-1]] = [float(w) for w in words[1:4]]
                if len(offsets[stack[-1]]) < 3 or not np.isfinite(offsets[stack[-1]]).all():
                    raise ValueError
            except ValueError as error:
                raise CaptureError(f"{where}: expected three numbers behind OFFSET; the file is damaged.") from error
        elif key == "CHANNELS":
            if not stack:
                raise CaptureError(f"{where}: channels stand before any joint; the file is damaged.")
            for word in words[2:]:
                axis, kind = word[0].upper(), word[1:].lower()
                if axis not in "XYZ" or kind not in ("position", "rotation"):
                    raise CaptureError(f"{where}: '{word}' is no channel; expected such as Xposition or Zrotation.")
                channels.append((stack[-1], axis, kind))
        elif key == "MOTION":
            if not channels:
                break
            return names, parents, np.array(offsets), channels, number
    raise CaptureError(f"{name}: no MOTION section was found; the file is truncated or not a BVH file.")


def _head(name: str, lines: list[str], motion: int) -> tuple[int, float]:
    """Count of frames and the interval between them, seconds."""
    try:
        frames = int(lines[motion].split(":")[1])
        interval = float(lines[motion + 1].split(":")[1])
    except (IndexError, ValueError) as error:
        raise CaptureError(f"{name}, line {motion + 1}: expected 'Frames:' and 'Frame Time:'; the file is damaged.") from error
    if frames < 1 or not np.isfinite(interval) or interval <= 0:
        raise CaptureError(
            f"{name}, line {motion + 1}: {frames} frames of {interval:g} seconds are no motion; write both as positive numbers."
        )
    return frames, interval


def _rows(name: str, lines: list[str], motion: int, frames: int, width: int) -> Array:
    """The numbers (frames, width) of the motion section."""
    rows = [(number, line) for number, line in enumerate(lines[motion + 2 :], motion + 3) if line.strip()]
    if len(rows) < frames:
        raise CaptureError(f"{name}, line {rows[-1][0] if rows else motion + 2}: {frames} frames are announced, {len(rows)} are there.")
    values = np.empty((frames, width))
    for row, (number, line) in enumerate(rows[:frames]):
        words = line.split()
        try:
            if len(words) != width:
                raise ValueError
            values[row] = np.array(words, dtype=float)
        except ValueError as error:
            raise CaptureError(f"{name}, line {number}: expected {width} numbers; the file is damaged.") from error
        if not np.isfinite(values[row]).all():
            raise CaptureError(f"{name}, line {number}: a value is not a number; repair or cut that frame.")
    return values
