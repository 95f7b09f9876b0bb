"""What composed training data covers: minutes, directions and distances of approach, heights, seams, by
action.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.contacts import TOES
from nsm_core.conventions import FOOT_CONTACTS, FPS, GOAL_ACTIONS, STYLES
from nsm_core.errors import OutputError
from nsm_core.files import output
from nsm_core.model.features.state import PIVOT
from nsm_core.rotations import Array, direction_to_heading, wrap_angle

from .storage import Dataset, described

# Goals by what is asked for together, as in ``take.TimedCommand``; those with a static place have directions
# and distances.
KINDS = {
    "sit": ("sit",),
    "carry: take": ("carry",),
    "carry: bring": ("idle", "carry"),
    "open: reach": ("open",),
    "open: pass": ("walk", "open"),
    "climb": ("idle", "walk"),
    "stand there": ("idle",),
}
GLIDES, LOW = 0.12, 0.04  # m/s, and metres of a toe joint over the floor
ABOUT = 10  # frames before and after a place where two captured pieces meet that are looked at
_BEARINGS, _DISTANCES, _HEIGHTS = np.arange(0, 181, 30), np.arange(0, 6.1, 0.5), np.arange(0, 1.31, 0.1)


@dataclass(frozen=True)
class Approaches:
    """Begun goals of one kind: degrees (N,) between the goal's front and where one comes from, metres (N,) to
    it, its heights (N,).
    """

    bearing: Array
    distance: Array
    height: Array


def approaches(data: Dataset) -> dict[str, Approaches]:
    """All begun static goals by kind."""
    a = data.arrays
    action = np.array(a["goal_action"][:, PIVOT]) > 0.5
    takes = np.array(a["start"])
    found = {}
    for kind, asked in KINDS.items():
        mine = (action == np.isin(GOAL_ACTIONS, asked)).all(axis=1)
        begins = np.flatnonzero(
            mine & ~(np.append(False, mine[:-1]) & np.append(False, takes[1:] == takes[:-1]))
        )
        goal, root = np.array(a["goal_position"][begins, PIVOT]), np.array(a["root"][begins])
        away = root[:, :2] - goal[:, :2]
        bearing = np.degrees(
            wrap_angle(direction_to_heading(away) - np.array(a["goal_heading"][begins, PIVOT]))
        )
        found[kind] = Approaches(np.abs(bearing), np.linalg.norm(away, axis=1), goal[:, 2])
    return found


def _minutes(data: Dataset) -> dict[str, float]:
    style = np.array(data.arrays["style"]).sum(axis=0) / FPS / 60
    return {name: float(m) for name, m in zip(STYLES, style, strict=True)}


def _feet(a: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Of toes (T - 1, 2), from frame to frame: m/s sideways, whether they glide near the ground, and whether
    they are told to stand.
    """
    toes = np.array(a["joint_position"])[:, TOES]
    speed = np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1) * FPS
    return speed, (speed > GLIDES) & (toes[1:, :, 2] < LOW), np.array(a["contact"][1:, FOOT_CONTACTS]) > 0.5


def _centimetres(speed: Array, stands: Array) -> float:
    """cm/s, mean, of feet that are told to stand."""
    return 100 * float(speed[stands].mean()) if stands.any() else 0.0


def gliding(data: Dataset) -> dict[str, tuple[float, float]]:
    """By action, of the frames that it begins or ends in (between none and all of it): share of feet in them
    that go sideways near the ground, landings and lift-offs among them; and cm/s, mean, of feet that are
    told to stand.
    """
    a = data.arrays
    same = np.array(a["start"][1:]) == np.array(a["start"][:-1])
    speed, glide, stands = _feet(a)
    found = {}
    for n, name in enumerate(STYLES):
        share = np.array(a["style"][1:, n])
        between = same & (share > 0.2) & (share < 0.8)
        if between.any():
            found[name] = float(glide[between].mean()), _centimetres(speed[between], stands[between])
    return found


@dataclass(frozen=True)
class Seams:
    """Motion within ABOUT frames of where captured pieces meet, feet and objects fitted: share of ``glides``
    and cm/s of feet that are told to ``stand``, as in ``gliding``; ``acceleration``, m/s^2, and ``jerk``,
    m/s^3, of the joint that has most of it, mean of ``count`` seams; ``mean_jerk`` over all joints, m/s^3.
    """

    count: int
    glides: float
    stand: float
    acceleration: float
    jerk: float
    mean_jerk: float


def at_seams(data: Dataset, takes: list[dict[str, Any]]) -> Seams | None:
    """Of the ``takes`` of ``data.json``; None where no pieces meet far enough from both ends of one."""
    a = data.arrays
    speed, glide, stands = _feet(a)
    parts, most = [], []
    for take in takes:
        ends = take["start"] + np.cumsum([piece[3] for piece in take["pieces"]])
        for seam in ends[:-1]:
            first, end = int(seam) - ABOUT, int(seam) + ABOUT
            if first < take["start"] or end > ends[-1]:
                continue
            joints = np.array(a["joint_position"][first:end], dtype=np.float64)
            changes = [np.linalg.norm(np.diff(joints, n, axis=0), axis=-1) * FPS**n for n in (2, 3)]
            most.append((*(change.max() for change in changes), changes[1].mean()))
            parts.append(slice(first, end - 1))
    if not parts:
        return None
    speeds, glides, standing = (np.concatenate([v[part] for part in parts]) for v in (speed, glide, stands))
    return Seams(
        len(parts), float(glides.mean()), _centimetres(speeds, standing), *np.mean(most, axis=0).tolist()
    )


def _seams(meta: dict[str, Any]) -> Array:
    """Captured pieces per minute of each take."""
    starts = [t["start"] for t in meta["takes"].values()] + [meta["frames"]]
    return np.array(
        [
            len(t["pieces"]) * FPS * 60 / max(n, 1)
            for t, n in zip(meta["takes"].values(), np.diff(starts), strict=True)
        ]
    )


def report(folder: str | Path) -> str:
    """Count what the data in ``folder`` holds, as text."""
    data, meta = Dataset.open(folder), described(folder)
    lines = [f"{meta['frames'] / FPS / 60:.1f} minutes in {len(meta['takes'])} takes"]
    lines.append("minutes by action: " + ", ".join(f"{k} {m:.1f}" for k, m in _minutes(data).items() if m))
    for kind, found in approaches(data).items():
        if not len(found.bearing):
            continue
        parts = []
        for name, values, edges in (
            ("degrees from its front", found.bearing, _BEARINGS),
            ("metres", found.distance, _DISTANCES[::2]),
            ("height", found.height, _HEIGHTS[::2]),
        ):
            counts, _ = np.histogram(values, edges)
            bins = zip(edges[:-1], edges[1:], counts, strict=True)
            parts.append(f"{name} " + ", ".join(f"{lo:.3g}-{hi:.3g}: {n}" for lo, hi, n in bins if n))
        lines.append(f"{kind}: {len(found.bearing)} goals; " + "; ".join(parts))
    glides = gliding(data).items()
    lines.append(
        "where an action begins or ends, feet that glide near the ground, and cm/s of those that stand: "
        + ", ".join(f"{name} {share:.1%} {speed:.1f}" for name, (share, speed) in glides)
    )
    lines.append(f"captured pieces per minute: {np.median(_seams(meta)):.1f} (median of takes)")
    seams = at_seams(data, list(meta["takes"].values()))
    if seams is not None:
        lines.append(
            f"within {ABOUT} frames of {seams.count} places where they meet: feet that glide near the ground "
            f"{seams.glides:.1%}, cm/s of those that stand {seams.stand:.1f}; largest of a joint "
            f"{seams.acceleration:.0f} m/s^2 and {seams.jerk:.0f} m/s^3, mean of all {seams.mean_jerk:.0f} "
            "m/s^3"
        )
    return "\n".join(lines)


def draw_coverage(folder: str | Path, path: str | Path) -> Path:
    """Draw the same as one picture: minutes, seams, and directions, distances and heights of each kind of
    goal.
    """
    try:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise OutputError("Pictures need matplotlib; install the development requirements.") from error
    data, meta = Dataset.open(folder), described(folder)
    found = {k: v for k, v in approaches(data).items() if len(v.bearing)}
    figure, axes = plt.subplots(len(found) + 1, 3, figsize=(13, 2.3 * (len(found) + 1)), squeeze=False)
    minutes = _minutes(data)
    axes[0, 0].barh(list(minutes), list(minutes.values()), color="#5b7f95")
    axes[0, 0].set_title(f"minutes by action, of {meta['frames'] / FPS / 60:.0f} in all")
    axes[0, 1].hist(_seams(meta), bins=20, color="#5b7f95")
    axes[0, 1].set_title("captured pieces per minute, by take")
    lengths = np.diff([t["start"] for t in meta["takes"].values()] + [meta["frames"]]) / FPS
    axes[0, 2].hist(lengths, bins=20, color="#5b7f95")
    axes[0, 2].set_title("seconds of a take")
    for row, (kind, a) in zip(axes[1:], found.items(), strict=True):
        for axis, values, edges, name in (
            (row[0], a.bearing, _BEARINGS, "degrees between its front and where one comes from"),
            (row[1], a.distance, _DISTANCES, "metres at its beginning"),
            (row[2], a.height, _HEIGHTS, "height of its place, metres"),
        ):
            axis.hist(values, bins=edges, color="#a3824f", edgecolor="white")
            axis.set_title(f"{kind} ({len(values)}): {name}", fontsize=9)
    figure.tight_layout()
    try:
        with output(path, "The picture") as temporary:
            figure.savefig(temporary, dpi=80, format=Path(path).suffix[1:] or "png")
    finally:
        plt.close(figure)
    return Path(path)
