"""Parse BVH files as forgivingly as Blender's own importer, and tell what was mended.

Blank lines, any line ends, tabs, missing colons, small letters, decimal commas and any usual encoding are
read without a word; a count that is one off, a last row that is cut off or a frame time of zero with a note;
everything else that does not fit is refused with its line, before anything is allocated for it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, quat_from_axis_angle, quat_mul
from nsm_core.validate import plain_line_ends, read_text

from .bvh_file import Bvh, check_size

SLOWEST, FASTEST = 2.0, 5000.0  # frames a second of any capture of bodies
MOST_JOINTS = 4000
_MOST = 1e9  # of any number in a file: farther than any studio, more than any angle
_AXES = {"X": np.array((1.0, 0, 0)), "Y": np.array((0, 1.0, 0)), "Z": np.array((0, 0, 1.0))}
_FRAMES, _TIME = (
    re.compile(rf"(?i)\b{words}\s*[:=]?\s*(?P<value>[^\s:=]+)")
    for words in (r"frames\b", r"frame[\s_]*time\b")
)


@dataclass
class Hierarchy:
    """The upper part of a file: names, parents, offsets, channels (joint, axis, kind), and the index of
    MOTION's line.
    """

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[tuple[int, str, str]] = field(default_factory=list)
    motion: int = 0
    placed: set[int] = field(default_factory=set)  # joints whose offset is written

    def bare(self, name: str) -> Bvh:
        """The hierarchy as a file without frames."""
        count = len(self.names)
        empty = np.zeros((0, count, 3)), np.zeros((0, count, 4))
        return Bvh(name, tuple(self.names), tuple(self.parents), np.array(self.offsets), *empty, 1 / FPS)


def parse(path: str | Path, rate: float | None = None) -> Bvh:
    """Read a BVH file without changing anything; CaptureError names the line where it is damaged.

    ``rate``, frames a second, is believed instead of what the file says of its frame time.
    """
    path = Path(path)
    lines = _lines(path)
    found, notes = _hierarchy(path.name, lines), []
    unplaced = [name for j, name in enumerate(found.names) if j not in found.placed and found.parents[j] >= 0]
    if unplaced:
        notes.append(
            f"{path.name}: {len(unplaced)} joints, such as {unplaced[0]}, have no OFFSET; they are read "
            "where their parents are."
        )
    frames, interval, start = _head(path.name, lines, found.motion, rate, notes)
    values = _rows(path.name, lines, start, frames, len(found.channels), notes)
    count = len(values)
    check_size(path.stem, count, len(found.names))
    offsets = np.array(found.offsets)
    places = np.tile(offsets, (count, 1, 1))
    rotations = np.zeros((count, len(found.names), 4))
    rotations[..., 0] = 1
    for column, (joint, axis, kind) in enumerate(found.channels):
        if kind == "position":  # the place that is written replaces the offset, as most programs have it
            places[:, joint, "XYZ".index(axis)] = values[:, column]
        else:
            turn = quat_from_axis_angle(
                np.broadcast_to(_AXES[axis], (count, 3)), np.radians(values[:, column])
            )
            rotations[:, joint] = quat_mul(rotations[:, joint], turn)
    return Bvh(
        path.stem,
        tuple(found.names),
        tuple(found.parents),
        offsets,
        places,
        rotations,
        interval,
        tuple(notes),
    )


def parse_hierarchy(path: str | Path) -> Bvh:
    """Read the hierarchy of a BVH file alone: no frames; errors as of ``parse``."""
    path = Path(path)
    return _hierarchy(path.name, _lines(path)).bare(path.stem)


def _lines(path: Path) -> list[str]:
    return plain_line_ends(read_text(path, CaptureError)).split("\n")


def _hierarchy(name: str, lines: list[str]) -> Hierarchy:
    found = Hierarchy()
    stack: list[Any] = []
    for number, line in enumerate(lines, 1):
        words, where = line.replace("{", " { ").replace("}", " } ").split(), f"{name}, line {number}"
        while words:
            key = words.pop(0).upper().rstrip(":")
            if key == "MOTION":
                if not found.channels:
                    raise CaptureError(
                        f"{where}: MOTION stands here, but no joint has channels; the file is damaged."
                    )
                found.motion = number - 1
                return found
            if key == "}":
                if not stack:
                    raise CaptureError(
                        f"{where}: a bracket closes that was never opened; the file is damaged."
                    )
                stack.pop()
            elif key in ("ROOT", "JOINT", "END", "ENDSITE"):
                stop = words.index("{") if "{" in words else len(words)
                _open(found, stack, key, " ".join(words[:stop]), where)
                words = words[stop:]
            elif key == "OFFSET" and stack:
                stop = words.index("}") if "}" in words else len(words)
                found.offsets[stack[-1]] = _offset(words[:stop], where)
                found.placed.add(stack[-1])
                words = words[stop:]
            elif key == "CHANNELS":
                if not stack:
                    raise CaptureError(f"{where}: channels stand before any joint; the file is damaged.")
                while (
                    len(words) > 1 and words[1] not in ("{", "}") and words[1].upper() not in ("JOINT", "END")
                ):
                    found.channels.append(_channel(stack[-1], words.pop(1), where))
                words = words[1:]
            elif key != "{":
                break  # remarks and what other programs add
    raise CaptureError(f"{name}: no MOTION section was found; the file is truncated or not a BVH file.")


def _open(found: Hierarchy, stack: list[int], key: str, joint: str, where: str) -> None:
    """Add a joint or an end site to the hierarchy."""
    end = key.startswith("END")
    if not end and not joint:
        raise CaptureError(f"{where}: a joint has no name; the file is damaged.")
    if end and not stack:
        raise CaptureError(f"{where}: an end stands before any joint; the file is damaged.")
    if len(found.names) >= MOST_JOINTS:
        raise CaptureError(
            f"{where}: there are more than {MOST_JOINTS} joints; that is no body, export its skeleton alone."
        )
    found.parents.append(stack[-1] if stack and key != "ROOT" else -1)
    stack.append(len(found.names))
    found.names.append(f"{found.names[found.parents[-1]]}_End" if end else joint)
    found.offsets.append([0.0, 0.0, 0.0])


def _offset(words: list[str], where: str) -> list[float]:
    try:
        values = [float(w) for w in _split(" ".join(words), 3)[:3]]
        if len(values) < 3 or not all(abs(v) < _MOST for v in values):
            raise ValueError
    except ValueError as error:
        raise CaptureError(f"{where}: expected three numbers behind OFFSET; the file is damaged.") from error
    return values


def _channel(joint: int, word: str, where: str) -> tuple[int, str, str]:
    axis, kind = word[0].upper(), word[1:].lower()
    if axis not in "XYZ" or kind not in ("position", "rotation"):
        raise CaptureError(f"{where}: '{word[:40]}' is no channel; expected such as Xposition or Zrotation.")
    return joint, axis, kind


def _split(text: str, width: int) -> list[str]:
    """Words of a line of ``width`` numbers: commas are decimal where the count fits so, else they part
    numbers.
    """
    if "," not in text and ";" not in text:
        return text.split()
    words = [w for w in (w.strip(",") for w in text.replace(";", " ").split()) if w]
    return (
        [w.replace(",", ".") for w in words]
        if len(words) == width
        else text.replace(",", " ").replace(";", " ").split()
    )


def _head(
    name: str, lines: list[str], motion: int, rate: float | None, notes: list[str]
) -> tuple[int | None, float, int]:
    """Count of frames (None: not said), the interval between them, seconds, and the index of the first line
    behind the head.
    """
    said: dict[str, str] = {}
    at = motion
    lines = [*lines[:motion], re.sub(r"(?i)^\s*motion:?", "", lines[motion]), *lines[motion + 1 :]]
    while at < len(lines) and len(said) < 2:
        found = {
            key: m["value"] for key, p in (("frames", _FRAMES), ("time", _TIME)) if (m := p.search(lines[at]))
        }
        if lines[at].strip() and not found:
            break
        said |= found
        at += 1
    where = f"{name}, line {min(at, len(lines))}"
    try:
        frames = float(said["frames"]) if "frames" in said else None
        interval = float(said.get("time", "0").replace(",", ".")) if rate is None else 1 / rate
        if not said or (frames is not None and frames % 1):
            raise ValueError
    except (ValueError, OverflowError) as error:
        raise CaptureError(
            f"{where}: expected 'Frames:' and 'Frame Time:', each with a number; the file is damaged."
        ) from error
    if frames is not None and not 0 <= frames < 1e15:
        raise CaptureError(
            f"{where}: {frames:g} frames are no motion; write how many rows of numbers there are."
        )
    return None if frames is None else int(frames), _interval(interval, where, notes), at


def _interval(interval: float, where: str, notes: list[str]) -> float:
    """The time between frames, seconds, that is believed."""
    if interval == 0:
        notes.append(
            f"{where}: no Frame Time is said; it is read at {FPS} frames a second (`rate` in mapping.toml "
            "says another)."
        )
        return 1 / FPS
    if not 1 / FASTEST <= interval <= 1 / SLOWEST:  # also what is not a number
        raise CaptureError(
            f"{where}: a Frame Time of {interval:g} would be {_frames_a_second(interval)}; it is in "
            "seconds, 0.0333333 for 30 frames "
            "a second: correct it, or say `rate = 30` in mapping.toml."
        )
    return interval


def _frames_a_second(interval: float) -> str:
    if not np.isfinite(interval) or interval <= 0:
        return "no motion"
    if interval > 1 / SLOWEST:
        return f"{interval:g} seconds from one frame to the next"
    return f"{1 / max(interval, 1e-300):.3g} frames a second"


def _rows(name: str, lines: list[str], start: int, frames: int | None, width: int, notes: list[str]) -> Array:
    """The numbers (T, width) of the motion section: as many rows as there are, at most one fewer than
    ``frames``.
    """
    filled = [k for k in range(start, len(lines)) if lines[k].strip()]
    wrapped, given = _layout([_split(lines[k], width) for k in filled[:1000]], width)
    rows: list[Array] = []
    cut = False
    for k in range(0, len(filled), wrapped):
        numbers = filled[k : k + wrapped]
        words = [w for n in numbers for w in _split(lines[n], given)]
        try:
            if len(words) != given:
                raise ValueError
            row = np.array(words[:width], dtype=float)
        except ValueError as error:
            if frames is not None and len(rows) >= frames:
                notes.append(f"{name}, line {numbers[0] + 1}: what stands behind the last frame is left out.")
                break
            if k + wrapped >= len(filled) and rows and len(words) <= given:
                notes.append(f"{name}, line {numbers[-1] + 1}: the last row is cut off; it is left out.")
                cut = True
                break
            raise CaptureError(
                f"{name}, line {numbers[0] + 1}: expected {width} numbers; the file is damaged."
            ) from error
        if not np.isfinite(row).all():
            raise CaptureError(
                f"{name}, line {numbers[0] + 1}: a value is not a number; repair or cut that frame."
            )
        if np.abs(row).max() > _MOST:
            raise CaptureError(
                f"{name}, line {numbers[0] + 1}: a value is beyond {_MOST:g}; repair or cut that frame."
            )
        rows.append(row)
    there = f"{frames} frames are announced, {len(rows)} are there"
    if not rows or (frames is not None and len(rows) < frames - 1):
        last = filled[-1] + 1 if filled else start
        raise CaptureError(
            f"{name}, line {last}: {there}; the file is cut off: export it again, or correct the count."
        )
    if frames not in (None, len(rows)) and not cut:
        notes.append(f"{name}: {there}; all of those are read.")
    if given > width:
        notes.append(
            f"{name}: every frame has {given} numbers, its joints have {width} channels; the last "
            f"{given - width} are left out."
        )
    return np.array(rows)


def _layout(rows: list[list[str]], width: int) -> tuple[int, int]:
    """Lines that one frame takes and the count of its numbers: the width, or more of them where every frame
    has more.
    """
    total = 0
    for k, words in enumerate(rows, 1):
        total += len(words)
        if total >= width:
            more = k == 1 and total > width and all(len(r) == total for r in rows[:-1])
            return (k, total) if more else (k, width) if total == width else (1, width)
    return 1, width
