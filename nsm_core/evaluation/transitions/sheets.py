"""Contact sheets of gaps of actors held out: what was captured, interpolated and told by the network."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.control.inbetween import Gap, fill
from nsm_core.data.transitions.windows import Windows
from nsm_core.evaluation.pictures.drawing import pyplot
from nsm_core.evaluation.pictures.figures import figure_sheet
from nsm_core.files import output
from nsm_core.model.inference.transition_model import TransitionModel
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES

FRAMES, EVERY = 30, 3


def notable(windows: Windows, frames: int) -> dict[str, int]:
    """Windows of actors held out whose gap of so many frames goes furthest, turns, rises and sinks most, and
    one as far as half of them.
    """
    chosen = windows.chosen(True, PAST + frames + TARGET_FRAMES)
    ends = windows.start[chosen] + PAST - 1, windows.start[chosen] + PAST + frames
    clips = [Clip("end", windows.hips[e], windows.local[e]) for e in ends]
    places, headings = zip(*(clip.root() for clip in clips), strict=True)
    way = np.linalg.norm(places[1] - places[0], axis=-1)
    turn = np.abs(np.angle(np.exp(1j * (headings[1] - headings[0]))))
    rise = windows.hips[ends[1], 2] - windows.hips[ends[0], 2]
    told = {
        "furthest": way.argmax(),
        "turn": turn.argmax(),
        "rise": rise.argmax(),
        "sink": rise.argmin(),
        "half": np.argsort(way)[len(way) // 2],
    }
    return {name: int(chosen[n]) for name, n in told.items()}


def draw_fills(windows: Windows, folder: Path, model: TransitionModel | None) -> list[Path]:
    """Draw the notable gaps from the side and from the front, one PNG each; returns their paths."""
    made = []
    for name, index in notable(windows, FRAMES).items():
        first = int(windows.start[index])
        span = slice(first, first + PAST + FRAMES + TARGET_FRAMES)
        clip = Clip("captured", windows.hips[span], windows.local[span])
        under = partial(windows.grounds[index, 0].height, windows.maps)
        gap = Gap(clip[:PAST], clip[-TARGET_FRAMES:], FRAMES, under)
        rows = {"captured": clip, "interpolated": _whole(gap, fill(gap, None).clip)}
        if model is not None:
            filled = fill(gap, model)
            rows[f"network ({100 * filled.gap_before_blend:.1f} cm)"] = _whole(gap, filled.clip)
        made.append(_sheet(rows, folder / f"fill_{name}.png", name))
    return made


def _whole(gap: Gap, filled: Clip) -> Clip:
    parts = (gap.past, filled, gap.target)
    return Clip(
        "filled",
        np.concatenate([p.hips_position for p in parts]),
        np.concatenate([p.local_rotations for p in parts]),
    )


def _sheet(rows: dict[str, Clip], path: Path, title: str) -> Path:
    images = []
    with tempfile.TemporaryDirectory() as folder:
        for view in ("side", "front"):
            for name, clip in rows.items():
                part = Path(folder) / "row.png"
                positions = clip.world()[0]
                figure_sheet(positions, part, EVERY, view, title=f"{title}, {name}, {view}", tiles=14, rows=1)
                images.append(pyplot().imread(part))
    width = min(i.shape[1] for i in images)
    with output(path, "The picture") as temporary:
        pyplot().imsave(temporary, np.concatenate([i[:, :width] for i in images]), format="png")
    return path


__all__ = ["draw_fills", "notable"]
