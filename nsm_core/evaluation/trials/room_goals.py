"""The benchmark of rooms: of every seed one furnished room, a start and a goal, the same on any machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.evaluation.measures.objects import moving_frames
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.props import Box
from nsm_core.world.scene.terrain import Terrain

from .rollout import SEED, Report, judge, shortest_way, summarise
from .rooms import goal_of, make_room, random_place, reachable
from .together import Trying, rolled

ACTIONS = ("walk", "sit", "carry", "open", "climb", "run")  # of seed 0, 1, ...
ROOMS = 200
CLEAN, NEAR, LATE = 5.0, 20.0, 40.0  # cm of depth and of error, and seconds, that a success has at most


def room_take(seed: int, pool: Pool | None = None) -> TakeRequest:
    """The take of a seed; GoalError where no room of it could be walked in."""

    def make(rng: np.random.Generator) -> TakeRequest:
        room = make_room(rng, pool)
        start = random_place(room, rng, room.query)
        goal = goal_of(room, ACTIONS[seed % len(ACTIONS)], rng)
        return TakeRequest(start, float(rng.uniform(-np.pi, np.pi)), [goal], room.query, seed=seed)

    return reachable(make, (SEED, 14, seed))


def run_room(
    model: Model, seed: int, pool: Pool | None = None, **more: Any
) -> Trying[tuple[TakeRequest, TakeResult, Report]]:
    """Roll out the take of a seed; returns it, what was made, and its figures."""
    asked = replace(room_take(seed, pool), **more)
    take = yield from rolled(model, asked)
    goal = asked.goals[0]
    ground = None
    if BY_KEY[goal.action].raises and goal.interaction is not None:
        ground = Terrain.probe(asked.environment, goal.interaction).height
    report, _ = judge(asked, take, ground, _shortest(asked, take))
    # How it ends counts; how deep it was on the way is a figure of its own.
    error = report["pe_cm"]
    near = not np.isfinite(error) or error < NEAR
    clean = report["penetration_end_cm"] <= CLEAN
    report["success"] = float(bool(report["reached"]) and near and clean and report["seconds"] <= LATE)
    return asked, take, report


def _shortest(asked: TakeRequest, take: TakeResult) -> float:
    """Metres of the shortest free way from the start to where the take ends, by where its box was lifted."""
    stops: list[Array] = [np.asarray(asked.start_position), take.root[-1, :2].astype(np.float64)]
    box = asked.goals[0].prop
    if isinstance(box, Box) and (lifted := moving_frames(take.props[box.name])).any():
        stops.insert(1, take.root[int(lifted.argmax()), :2].astype(np.float64))
    legs = 0.0
    for one, other in zip(stops[:-1], stops[1:], strict=True):
        way = shortest_way(replace(asked, start_position=one), other)
        legs += float(np.linalg.norm(other - one)) if way is None else way
    return legs


def badness(report: Report) -> float:
    """How bad a take is, to find the worst: failures first, then depth in solids and sliding, cm."""
    if report.get("failed"):
        return float("inf")
    return 1000 * (1 - report["success"]) + report["penetration_cm"] + report["slide_moving_cm_s"]


_ROWS = (
    ("seconds (median / worst)", "seconds", 1),
    ("way over the shortest (median / worst)", "path_ratio", 2),
    ("deepest penetration cm (median / worst)", "penetration_cm", 1),
    ("jerk m/s³ (median / worst)", "jerk_m_s3", 0),
    ("slide while moving cm/s (median / worst)", "slide_moving_cm_s", 1),
)


def rooms_table(reports: Sequence[tuple[str, Report]]) -> str:
    """The benchmark as text: a column for each action and one for all; ``reports`` are (action, figures)."""
    named = [a for a in ACTIONS if any(action == a for action, _ in reports)]
    columns = {a: [r for action, r in reports if action == a] for a in named}
    columns["all"] = [r for _, r in reports]
    sums = {name: summarise(some) for name, some in columns.items()}
    lines = [
        f"| {len(reports)} rooms | " + " | ".join(columns) + " |",
        "|---" * (len(columns) + 1) + "|",
        "| success | "
        + " | ".join(f"{np.mean([r.get('success', 0.0) for r in c]):.0%}" for c in columns.values())
        + " |",
        "| reached | " + " | ".join(f"{sums[name]['reached']:.0%}" for name in columns) + " |",
    ]
    for title, key, digits in _ROWS:
        cells = [
            f"{s.get(f'{key}_median', np.nan):.{digits}f} / {s.get(f'{key}_worst', np.nan):.{digits}f}"
            for s in sums.values()
        ]
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    deep = " | ".join(f"{s['deep_share']:.1%}" for s in sums.values())
    return "\n".join([*lines, f"| frames deeper than 3 cm | {deep} |"])
