"""Climbing trials: steps to stand on and low walls to step over, 0.2 to 0.6 m high."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.skeleton import HIPS, forward_kinematics
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.evaluation.measures.objects import foot_heights
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture
from nsm_core.world.scene.terrain import Terrain

from ..furniture_goals import climb_goal
from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

# Kind, height and depth in metres, and how wide; the rest is drawn.
SETTINGS = (
    ("step of 0.2 m", "step", {"height": 0.2, "depth": 0.8}),
    ("step of 0.3 m", "step", {"height": 0.3, "depth": 0.6}),
    ("step of 0.45 m", "step", {"height": 0.45, "depth": 0.9}),
    ("step of 0.6 m", "step", {"height": 0.6, "depth": 1.0}),
    ("low wall of 0.25 m", "low_wall", {"height": 0.25, "depth": 0.1}),
    ("low wall of 0.45 m", "low_wall", {"height": 0.45, "depth": 0.2}),
)
# Metres: root from its place, and hips over the ground, that count as standing there.
NEAR, UPRIGHT = 0.35, 0.75
FEET = 0.06  # metres that the higher foot may be off the ground it stands on
# Centimetres that the joints of the feet, and the body at all, may be inside the piece: who walks through it
# does not climb.
THROUGH, BODY_THROUGH = 5.0, 10.0


@dataclass(frozen=True)
class ClimbTrial:
    """One start before one piece at the world's origin, turned by ``turn``."""

    setting: int
    name: str
    start: Array
    heading: float
    piece: Furniture
    turn: float


def trials(starts: int = 10, settings: int = len(SETTINGS), pool: Pool | None = None) -> list[ClimbTrial]:
    """The same ``starts`` times ``settings`` trials at every call; the pieces are made, never drawn from a
    ``pool``.
    """
    result = []
    for n in range(settings):
        name, kind, measures = SETTINGS[n % len(SETTINGS)]
        rng = np.random.default_rng((SEED, 4, n))
        piece = furniture.make(kind, rng, **{"width": float(rng.uniform(1.0, 1.6)), **measures})
        turn = float(rng.uniform(-np.pi, np.pi))
        free = rollout.clear_of(furniture.cuboids([(piece, np.zeros(2), turn)]))
        for _ in range(starts):
            start, heading = rollout.start_about(rng, np.zeros(2), free)
            result.append(ClimbTrial(n, name, start, heading, piece, turn))
    return result


def request(trial: ClimbTrial, hold: float = 1.0, **more: Any) -> TakeRequest:
    """Set up one trial's take."""
    query = furniture.cuboids([(trial.piece, np.zeros(2), trial.turn)])
    goal = climb_goal(trial.piece, np.zeros(2), trial.turn, trial.start, hold)
    return TakeRequest(trial.start, trial.heading, [goal], query, **more)


def run_trial(model: Model, trial: ClimbTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)
    goal = asked.goals[0]
    assert goal.interaction is not None
    ground = Terrain.probe(asked.environment, goal.interaction).height
    take = yield from rolled(model, asked)
    report, _ = rollout.judge(asked, take, ground=ground)
    end = forward_kinematics(take.hips_position[-1], take.local_rotations[-1])[0].astype(np.float64)
    feet = foot_heights(end, ground)
    joints = forward_kinematics(take.hips_position, take.local_rotations)[0][:, ANKLES + TOES]
    inside = asked.environment.signed_distance(joints.reshape(-1, 3).astype(np.float32), 0.1)
    report |= {
        "end_off_cm": float(100 * np.linalg.norm(take.root[-1, :2] - goal.position[:2])),
        "hips_over_m": float(end[HIPS, 2] - goal.position[2]),
        "feet_off_cm": float(100 * np.abs(feet).max()),
        "feet_through_cm": float(100 * max(0.0, -float(inside.min()))),
        "over_wall": float(trial.piece.kind == "low_wall"),
    }
    on_level = bool((np.abs(np.asarray(ground(end[TOES, :2])) - goal.position[2]) < 0.05).all())
    stands = (
        report["end_off_cm"] < 100 * NEAR
        and report["hips_over_m"] > UPRIGHT
        and on_level
        and report["feet_off_cm"] < 100 * FEET
    )
    clean = report["feet_through_cm"] <= THROUGH and report["penetration_cm"] <= BODY_THROUGH
    report["stands"] = float(bool(report["reached"]) and stands and clean)
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return rollout.summarise(reports) | {
        "stands": rollout.share(reports, lambda r: r["stands"] > 0),
        "stands_on_top": rollout.share(
            [r for r in reports if not r.get("over_wall", 0)], lambda r: r["stands"] > 0
        ),
        "stands_behind": rollout.share(
            [r for r in reports if r.get("over_wall", 0)], lambda r: r["stands"] > 0
        ),
    }


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [
        (
            "stands on top or behind, and did not walk through",
            f"{s['stands']:.0%}",
            "99.8 % (TokenHSI)",
            "95 %",
        ),
        ("of these, on top of steps", f"{s['stands_on_top']:.0%}", "", ""),
        ("of these, behind low walls", f"{s['stands_behind']:.0%}", "", ""),
        (
            "standing feet off the ground cm (median / worst)",
            f"{s['feet_off_cm_median']:.1f} / {s['feet_off_cm_worst']:.1f}",
            "",
            "",
        ),
        (
            "root off its place cm (median / worst)",
            f"{s['end_off_cm_median']:.1f} / {s['end_off_cm_worst']:.1f}",
            "",
            "",
        ),
        (
            "feet through the piece cm (median / worst)",
            f"{s['feet_through_cm_median']:.1f} / {s['feet_through_cm_worst']:.1f}",
            "",
            "5",
        ),
        ("share of frames with a sole under the ground (mean)", f"{s['below_floor_share_mean']:.2f}", "", ""),
        ("seconds to climb (median)", f"{s['seconds_median']:.1f}", "", ""),
    ]


PART = TrialPart(
    "climb",
    lambda starts, pool: trials(starts, pool=pool),
    run_trial,
    summarise,
    rows,
    request,
    ("climb",),
    done="stands",
)
