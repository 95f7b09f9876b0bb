"""Performances on disk: a file each, so that making them may stop at any time; and what they cover."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core import npz
from nsm_core.body.skeleton import ARMS, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.source import Source
from nsm_core.errors import CaptureError
from nsm_core.files import output
from nsm_core.model.handling.tasks import APPROACHES, FREE, HOLDS
from nsm_core.signals import intervals

from .performances import Performance, perform
from .pieces import gathered

_KINDS = {"hips": "f", "rotations": "f", "feet": "b", "walk": "b", "tasks": "i", "keys": "b"}
_MOST = 1 << 28
BANDS = (0.0, 0.4, 0.8, 1.2, 1.6, 2.2)  # metres of height by which reaches are counted


@dataclass(frozen=True)
class HandlingLibrary:
    """Performances, in the order of their seeds."""

    performances: tuple[Performance, ...]

    @property
    def frames(self) -> int:
        """Frames of all."""
        return sum(len(p.hips) for p in self.performances)


def make_handling(
    folder: Path, captures: str | Path, frames: int, tell: Callable[[str], None]
) -> HandlingLibrary:
    """Make performances of ``captures`` until ``folder`` holds ``frames`` of them, and read them all."""
    source: Source | None = None
    made: list[Performance] = []
    seed = 0
    while sum(len(p.hips) for p in made) < frames:
        path = folder / f"performance_{seed:05d}.npz"
        if not path.exists():
            source = source or gathered(CaptureFolder(captures))
            found = perform(source, seed)
            arrays: dict[str, Any] = {}
            if found is not None:
                arrays = {name: getattr(found, name) for name in _KINDS}
            with output(path, "The performance") as temporary, open(temporary, "wb") as file:
                np.savez(file, **arrays)
        performance = _read(path)
        if performance is not None:
            made.append(performance)
        seed += 1
        if seed % 25 == 0:
            tell(f"{sum(len(p.hips) for p in made)} of {frames} frames")
    return HandlingLibrary(tuple(made))


def _read(path: Path) -> Performance | None:
    """A performance, None where its draw did not work out; CaptureError where the file is another."""
    try:
        arrays = npz.read_arrays(path, _KINDS, _MOST)
        if not arrays:
            return None
        if set(arrays) != set(_KINDS):
            raise ValueError("another format")
    except (OSError, ValueError, npz.DamagedArrays) as error:
        raise CaptureError(
            f"{path} holds no performance ({error}); delete it and it is made anew."
        ) from error
    return Performance(**arrays)


def handling_coverage(library: HandlingLibrary) -> str:
    """What performances show: seconds of every label by key joint (as table 2 of papers/002), and reaches by
    hand and height.
    """
    count = max(library.frames, 1)
    walk = sum(int(p.walk.sum()) for p in library.performances)
    lines = [
        f"{len(library.performances)} performances, {count / FPS / 60:.1f} minutes",
        "key joint  label  seconds  %",
    ]
    rows = [("hips", "idle", count - walk), ("hips", "walk", walk)]
    names = ("free", "approaches", "holds", "leaves")
    rows += [
        (hand, names[task], sum(int((p.tasks[:, side] == task).sum()) for p in library.performances))
        for side, hand in enumerate(("right", "left"))
        for task in range(FREE, len(names))
    ]
    lines += [f"{joint:9}  {label:10} {n / FPS:7.1f} {100 * n / count:5.1f}" for joint, label, n in rows]
    heights: tuple[list[float], list[float]] = ([], [])
    seconds: list[float] = []
    for p in library.performances:
        positions = forward_kinematics(p.hips, p.rotations)[0]
        for side, arm in enumerate(ARMS):
            heights[side].extend(positions[a, arm[2], 2] for a, _ in intervals(p.tasks[:, side] == HOLDS))
            seconds.extend((b - a) / FPS for a, b in intervals(p.tasks[:, side] == APPROACHES))
    lines.append(
        "reaches by height, m   "
        + "  ".join(f"{a:.1f}-{b:.1f}" for a, b in zip(BANDS, BANDS[1:], strict=False))
    )
    for side, hand in enumerate(("right", "left")):
        counted = np.histogram(heights[side], BANDS)[0]
        lines.append(f"  {hand:20} " + "  ".join(f"{n:7d}" for n in counted))
    both = heights[0] + heights[1]
    if both:
        lines.append(
            f"heights {min(both):.2f} to {max(both):.2f} m, a reach takes {np.mean(seconds):.2f} s on average"
        )
    return "\n".join(lines)


__all__ = ["HandlingLibrary", "handling_coverage", "make_handling"]
