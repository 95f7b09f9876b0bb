"""What composed training data covers: minutes, directions and distances of approach, seat heights, seams."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ..conventions import FPS, GOAL_ACTIONS, STYLES
from ..rotations import direction_to_heading, wrap_angle
from ..series import PIVOT
from .export import Dataset

_SIT = GOAL_ACTIONS.index("sit")


def report(folder: str | Path) -> str:
    """Count what the data in ``folder`` holds, as text."""
    data = Dataset.open(folder, in_memory=False)
    a = data.arrays
    meta = json.loads((Path(folder) / "data.json").read_text())
    style = np.array(a["style"])
    asked = np.array(a["goal_action"][:, PIVOT, _SIT]) > 0.5
    begins = np.flatnonzero(np.diff(np.concatenate(([False], asked)).astype(int)) > 0)
    goal, root = np.array(a["goal_position"][begins, PIVOT]), np.array(a["root"][begins])
    away = root[:, :2] - goal[:, :2]
    bearing = np.degrees(wrap_angle(direction_to_heading(away) - np.array(a["goal_heading"][begins, PIVOT])))
    distance = np.linalg.norm(away, axis=1)
    lines = [f"{meta['frames'] / FPS / 60:.1f} minutes in {len(meta['takes'])} takes, {len(begins)} sit-downs"]
    shares = (f"{n} {style[:, k].sum() / FPS / 60:.1f}" for k, n in enumerate(STYLES) if style[:, k].any())
    lines.append("minutes by action: " + ", ".join(shares))
    for name, values, edges in (
        ("start, degrees from the seat's front", np.abs(bearing), np.arange(0, 181, 30)),
        ("start, metres from the seat", distance, np.array([0, 1, 2, 3, 4, 6])),
        ("height of the seated hips, metres", goal[:, 2], np.arange(0.4, 0.75, 0.05)),
    ):
        counts, _ = np.histogram(values, edges)
        lines.append(f"{name}: " + ", ".join(f"{lo:.3g}-{hi:.3g}: {n}" for lo, hi, n in zip(edges[:-1], edges[1:], counts, strict=True)))
    pieces = sum(len(t["pieces"]) for t in meta["takes"].values())
    lines.append(f"captured pieces per minute: {pieces / max(meta['frames'] / FPS / 60, 1e-6):.1f}")
    return "\n".join(lines)
