"""One picture of a clip's annotation: stick figures, label ramps, contacts, phase and goals over one axis of
time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.clip import Clip, smoothed_root
from nsm_core.body.skeleton import HIPS, INDEX, JOINTS, PARENTS
from nsm_core.conventions import CONTACTS, FPS, STYLES
from nsm_core.errors import OutputError
from nsm_core.files import output
from nsm_core.rotations import Array, rotate_planar

from .proposal import Annotation

COLOURS = dict(
    zip(STYLES, ("#9aa0a6", "#4c9f70", "#d1495b", "#8f5fbf", "#c98a2b", "#2b7bb9", "#a05a2c"), strict=True)
)
_FIGURES = 18


def draw_annotation(
    clip: Clip, annotation: Annotation, path: str | Path, measured: Array | None = None
) -> Path:
    """Write the picture of an annotated clip and return its path; ``measured`` (T,) is a second phase to
    compare, cycles.

    Raises OutputError where matplotlib is absent or the file cannot be written.
    """
    try:
        import matplotlib
    except ImportError as error:
        raise OutputError(
            "Pictures need matplotlib; install it, or run the command with --no-pictures."
        ) from error
    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    count, frames = len(clip), np.arange(len(clip))
    figure = Figure(figsize=(15, 8), dpi=90, layout="constrained")
    rows = figure.subplots(5, 1, sharex=True, height_ratios=(2.6, 1.5, 1.1, 0.9, 1.2))
    _stick_figures(rows[0], clip)
    for k, name in enumerate(STYLES):
        rows[1].fill_between(frames, annotation.style[:, k], color=COLOURS[name], alpha=0.35, lw=0)
        rows[1].plot(frames, annotation.style[:, k], color=COLOURS[name], lw=1.4, label=name)
    rows[1].legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=8, frameon=False)
    rows[1].set_ylabel("actions")
    for k in range(len(CONTACTS)):
        rows[2].fill_between(
            frames, k + 0.1, k + 0.1 + 0.8 * annotation.contact[:, k], step="mid", color="#444", lw=0
        )
    rows[2].set_yticks(np.arange(len(CONTACTS)) + 0.5, CONTACTS, fontsize=8)
    rows[2].set_ylim(0, len(CONTACTS))
    rows[3].plot(frames, annotation.phase % 1, ".", ms=3, color="#222", label="phase")
    rows[3].plot(frames, annotation.phase_mirrored % 1, ".", ms=1.5, color="#bbb", label="mirrored")
    if measured is not None:
        rows[3].plot(frames, measured % 1, ".", ms=2.5, color="#d1495b", label="autoencoder")
    rows[3].legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=8, frameon=False)
    rows[3].set_ylabel("phase")
    _goals(rows[4], annotation)
    rows[4].set_xlim(0, max(count - 1, 1))
    rows[4].set_xlabel("frame (30 a second)")
    for row in rows:
        row.grid(axis="x", color="#ddd", lw=0.5)
        row.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{clip.name}   {count / FPS:.1f} s", fontsize=11, x=0.01, ha="left")
    with output(path, "The picture") as temporary:
        figure.savefig(temporary, format=Path(path).suffix[1:] or "png")
    return Path(path)


def _stick_figures(row: Any, clip: Clip) -> None:
    """Poses from the character's left, at their frames."""
    from matplotlib.collections import LineCollection

    positions, _ = clip.world()
    root, heading = smoothed_root(positions)
    local = positions.copy()
    local[..., :2] -= positions[:, HIPS, None, :2]
    ahead = -rotate_planar(local, -heading[:, None])[..., 1]
    count, top = len(clip), 2.0
    shown = np.unique(np.linspace(0, count - 1, min(_FIGURES, count)).round().astype(int))
    wide = row.get_figure().get_size_inches()
    scale = (count - 1) * 2.6 / (0.83 * wide[0]) * 0.9  # frames a metre, about as long across as up
    for f in shown:
        x, z = f + ahead[f] * scale / 1.15, positions[f, :, 2]
        bones = [((x[p], z[p]), (x[j], z[j])) for j, p in enumerate(PARENTS) if p >= 0]
        hues = [
            "#d1495b" if "Right" in JOINTS[j] else "#2b7bb9" if "Left" in JOINTS[j] else "#222"
            for j, p in enumerate(PARENTS)
            if p >= 0
        ]
        row.add_collection(LineCollection(bones, colors=hues, linewidths=1.3))
        head, neck = (np.array((x[INDEX[n]], z[INDEX[n]])) for n in ("Head", "Neck"))
        row.plot(*(head + 0.6 * (head - neck)), "o", mfc="white", mec="#222", ms=8, zorder=3)
        row.plot([f], [0], "|", color="#888", ms=6)
    low = min(0.0, float(positions[..., 2].min()))
    row.set_ylim(low - 0.05, max(top, float(positions[..., 2].max()) + 0.1))
    row.axhline(0, color="#8c8c8c", lw=0.8)
    row.set_ylabel("metres, facing right")


def _goals(row: Any, annotation: Annotation) -> None:
    """Bars of the goals in force, from their frame to the next one's, with their places."""
    goals = annotation.goals
    for n, (goal, end) in enumerate(
        zip(goals, [*(g.frame for g in goals), len(annotation)][1:], strict=True)
    ):
        row.barh(
            0,
            end - goal.frame,
            left=goal.frame,
            height=0.8,
            color=COLOURS[goal.action.split("+")[-1]],
            alpha=0.45,
            edgecolor="white",
        )
        where = "" if goal.place is None else " ({:.1f}, {:.1f}, {:.2f})".format(*goal.place)
        row.text(
            goal.frame + 1,
            0.24 - 0.24 * (n % 3),
            goal.action + where,
            fontsize=7.5,
            va="center",
            clip_on=True,
        )
    row.set_yticks([])
    row.set_ylabel("goal")
