"""Table 4 of papers/002: what the goal's phase is worth, beside the data; and figure 5."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from nsm_core.body.skeleton import ARMS
from nsm_core.conventions import FPS, STYLES
from nsm_core.data.handling.tracks import HandlingTracks
from nsm_core.evaluation.measures.motion import foot_sliding
from nsm_core.evaluation.measures.naturalness import Space, WatchedMotion, windows
from nsm_core.evaluation.pictures.drawing import pyplot, save
from nsm_core.model.handling.phase import control_of
from nsm_core.rotations import Array

from .rolled import MovedBody

REACHED = 0.05  # metres from its goal within which a hand counts as there
_SLOW = 0.15  # m/s of a wrist under which its way has no curvature worth telling
HEAD = (
    "| goal's phase | acceleration, m/s2 | sliding, cm/s | Frechet | wrist's curvature, 1/cm | wrist off, cm "
    "| reached, % |\n|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True)
class JudgedHandling:
    """``acceleration`` m/s2, mean over joints (the paper's unsmoothness); ``sliding`` cm/s of feet, by how
    low they are; ``distance`` of windows of 2 s from the data, see ``measures.naturalness``; ``curvature``
    1/cm, root mean square over the ways of wrists to things and back, mean over ways; ``missed`` metres of
    wrists as they begin to hold, median; ``reached`` share of them within REACHED.
    """

    acceleration: float
    sliding: float
    distance: float
    curvature: float
    missed: float
    reached: float

    def row(self, name: str) -> str:
        """A row of the table."""
        return (
            f"| {name} | {self.acceleration:.2f} | {self.sliding:.2f} | {self.distance:.3f} | "
            f"{self.curvature:.4f} | {100 * self.missed:.1f} | {100 * self.reached:.0f} |"
        )


def judge(bodies: Sequence[MovedBody], data: Sequence[MovedBody]) -> JudgedHandling:
    """Judge motions beside those of ``data``."""
    seen, known = _windows(bodies), _windows(data)
    missed = np.array([m.missed for b in bodies for m in b.moves if np.isfinite(m.missed)])
    curvatures = [curvature(b.positions[m.span, ARMS[m.side][2]]) for b in bodies for m in b.moves]
    return JudgedHandling(
        float(np.mean([acceleration(b.positions) for b in bodies])),
        float(np.mean([foot_sliding(b.positions, weighted=True) for b in bodies])),
        Space.of(known).distance(known, seen),
        float(np.nanmean(curvatures)) if curvatures else float("nan"),
        float(np.median(missed)) if len(missed) else float("nan"),
        float((missed < REACHED).mean()) if len(missed) else float("nan"),
    )


def acceleration(positions: Array) -> float:
    """Mean size of all joints' acceleration, m/s2, of positions (T, J, 3)."""
    second = np.diff(positions.astype(np.float64), n=2, axis=0) * FPS**2
    return float(np.linalg.norm(second, axis=-1).mean())


def curvature(way: Array) -> float:
    """Root mean square of the curvature of a way (T, 3), metres, in 1/cm, where it is gone and not stood; NaN
    where it is not gone at all.
    """
    if len(way) < 5:
        return float("nan")
    speed = np.gradient(way.astype(np.float64), axis=0) * FPS
    change = np.gradient(speed, axis=0) * FPS
    size = np.linalg.norm(speed, axis=-1)
    bent = np.linalg.norm(np.cross(speed, change), axis=-1) / np.maximum(size, _SLOW) ** 3
    bent = bent[size > _SLOW]
    return float(np.sqrt(np.square(bent).mean()) / 100) if len(bent) else float("nan")


def control_figure(tracks: HandlingTracks, path: Path) -> str:
    """Draw the distribution of the control of amplitudes and frequencies over the data (figure 5); returns
    one line of its figures: it is to be about zero, and as a normal one.
    """
    inside = np.flatnonzero(np.arange(len(tracks.phase)) < tracks.last)
    control = control_of(tracks.phase[inside].astype(np.float64), tracks.phase[inside + 1])
    plt = pyplot()
    figure, axes = plt.subplots(1, 3, figsize=(9, 2.6))
    lines = []
    for axis, k, name in zip(axes, range(3), ("phase", "amplitude", "frequency"), strict=True):
        values = control[:, k].ravel()
        mean, spread = values.mean(), max(float(values.std()), 1e-9)
        tails = float((((values - mean) / spread) ** 4).mean() - 3)
        lines.append(f"{name} {mean:+.4f} +- {spread:.4f} (excess kurtosis {tails:.1f})")
        bins = np.linspace(-4 * spread, 4 * spread, 81)
        axis.hist(values, bins, density=True, color="#1f6fb4")
        axis.plot(bins, np.exp(-((bins - mean) ** 2) / (2 * spread**2)) / (spread * np.sqrt(2 * np.pi)), "k")
        axis.set_title(f"control of {name}", fontsize=9)
    figure.tight_layout()
    save(plt, figure, path)
    return "control over the data: " + "; ".join(lines)


def as_rows(judged: dict[str, JudgedHandling]) -> list[dict[str, float | str]]:
    """Plain values, ready for JSON."""
    return [{"goal_phase": name, **asdict(found)} for name, found in judged.items()]


def _windows(bodies: Sequence[MovedBody]) -> Array:
    none = np.zeros(len(STYLES), np.float32)
    found = [
        windows(WatchedMotion("", "", "", b.positions, np.tile(none, (len(b.positions), 1))), "all", "2 s")
        for b in bodies
    ]
    return np.concatenate(found)


__all__ = ["HEAD", "JudgedHandling", "as_rows", "control_figure", "curvature", "judge"]
