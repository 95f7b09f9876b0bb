"""Touch trials: points at several heights on the fronts of cabinets, shelves and walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture

from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

# Name, kind of the piece, and the height of the point on its front as a share of the piece's.
SETTINGS = (
    ("low on a cabinet", "cabinet", 0.7),
    ("high on a cabinet", "cabinet", 0.95),
    ("on a shelf", "shelf", 0.75),
)


@dataclass(frozen=True)
class TouchTrial:
    """One start and the point (3,) on the front of a piece at the origin with heading ``turn``."""

    setting: int
    name: str
    start: Array
    heading: float
    piece: Furniture
    turn: float
    point: Array


def trials(starts: int = 10) -> list[TouchTrial]:
    """The same ``starts`` trials of each of ``SETTINGS`` at every call."""
    result = []
    for n, (name, kind, share) in enumerate(SETTINGS):
        rng = np.random.default_rng((SEED, 13, n))
        piece, turn = furniture.make(kind, rng), float(rng.uniform(-np.pi, np.pi))
        front = (
            (piece.mins[:, 0].min() + piece.maxs[:, 0].max()) / 2,
            piece.mins[:, 1].min(),
            share * piece.size[2],
        )
        point = rotate_planar(np.array(front, dtype=np.float64), np.float64(turn))
        free = rollout.clear_of(furniture.cuboids([(piece, np.zeros(2), turn)]))
        for _ in range(starts):
            start, heading = rollout.start_about(rng, np.zeros(2), free)
            result.append(TouchTrial(n, name, start, heading, piece, turn, point))
    return result


def request(trial: TouchTrial, hold: float = 1.0, **more: Any) -> TakeRequest:
    """Set up one trial's take."""
    goal = Goal("touch", trial.piece.kind, trial.point, trial.turn + np.pi, hold)
    return TakeRequest(
        trial.start,
        trial.heading,
        [goal],
        furniture.cuboids([(trial.piece, np.zeros(2), trial.turn)]),
        **more,
    )


def run_trial(model: Model, trial: TouchTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)
    take = yield from rolled(model, asked)
    report, _ = rollout.judge(asked, take)
    return take, report


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [
        ("touched", f"{s['reached']:.0%}", "", "95 %"),
        ("hand off its place cm, with contact IK (mean)", f"{s['hand_pe_cm_mean']:.2f}", "", "1"),
        (
            "hand off its place cm, network alone, which is told to stand (mean)",
            f"{s['network_hand_pe_cm_mean']:.2f}",
            "",
            "",
        ),
        ("seconds to touch (median)", f"{s['seconds_median']:.1f}", "", ""),
    ]


PART = TrialPart(
    "touch", lambda starts, pool: trials(starts), run_trial, rollout.summarise, rows, request, ("touch",),
)  # fmt: skip
