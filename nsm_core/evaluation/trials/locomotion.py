"""Locomotion trials: how soon an order is answered, walks between furniture and through holes in walls, runs
in the open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.control.actions.base import EXECUTED
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.conventions import FPS, RUN, SIT, STYLES
from nsm_core.errors import GoalError
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.assets.pool import Pool
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture

from ..furniture_goals import sit_goal
from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .sit import SEATS
from .together import Trying, rolled

OBSTACLES = ("table", "desk", "cabinet", "box", "chair", "armchair", "sofa", "stool", "shelf")
WAY, PIECES = 5.0, 9  # metres from start to goal, and pieces of furniture about the way
_PATIENCE = 12.0  # seconds after which an order counts as not answered
LEAD = {"walk": 1.5, "run": 3.5}  # metres gone before the order to sit comes


@dataclass(frozen=True)
class WalkTrial:
    """Start, goal and solids of a way: pieces are (furniture, place, heading)."""

    setting: int
    name: str
    start: Array
    heading: float
    goal: Array
    still: tuple[tuple[Furniture, Array, float], ...] = ()
    action: str = "walk"


# --- ways ---


def trials(starts: int = 10, pool: Pool | None = None) -> list[WalkTrial]:
    """Twice ``starts`` furnished rooms, ``starts`` walls with a hole, ``starts`` runs in the open; the same
    at every call.
    """
    rooms = [_room(n, pool) for n in range(2 * starts)]
    holes = [_hole(n, pool) for n in range(starts)]
    return rooms + holes + [_open(n) for n in range(starts)]


def _room(number: int, pool: Pool | None) -> WalkTrial:
    rng = np.random.default_rng((SEED, 6, number))
    while True:
        way = WAY * heading_to_direction(np.array(rng.uniform(-np.pi, np.pi)))
        side = np.array((-way[1], way[0])) / WAY
        still: list[tuple[Furniture, Array, float]] = []
        for n in range(PIECES):
            kind = str(rng.choice(OBSTACLES))
            piece = pool.draw(kind, rng) if pool is not None else furniture.make(kind, rng)
            # The first ones stand in the way, the others about it.
            along, aside = (
                (rng.uniform(0.3, 0.7), rng.normal(0, 0.3))
                if n < 2
                else (rng.uniform(-0.1, 1.1), rng.uniform(-2.2, 2.2))
            )
            place, radius = along * way + aside * side, float(max(piece.size[:2])) / 2
            if all(
                np.linalg.norm(place - at) > radius + float(max(p.size[:2])) / 2 + 0.05 for p, at, _ in still
            ):
                still.append((piece, place, float(rng.uniform(-np.pi, np.pi))))
        query = furniture.cuboids(still)
        free = rollout.clear_of(query, room=0.5)
        if not (free(np.zeros(2)) and free(way)):
            continue
        try:
            FloorPlan(query, (np.minimum(way, 0) - 4, np.maximum(way, 0) + 4)).find(np.zeros(2), way)
        except GoalError:
            continue
        return WalkTrial(0, "room", np.zeros(2), float(rng.uniform(-np.pi, np.pi)), way, tuple(still))


def _hole(number: int, pool: Pool | None) -> WalkTrial:
    rng = np.random.default_rng((SEED, 7, number))
    wall = furniture.make("hole_wall", rng, width=9.0, along=float(rng.uniform(0.3, 0.7)))
    turn, side = float(rng.uniform(-np.pi, np.pi)), float(rng.choice((-1, 1)))
    ends = [np.array((rng.uniform(-1.5, 1.5), s * side * WAY / 2)) for s in (-1, 1)]
    start, goal = (rotate_planar(p, np.float64(turn)) for p in ends)
    return WalkTrial(1, "hole", start, float(rng.uniform(-np.pi, np.pi)), goal, ((wall, np.zeros(2), turn),))


def _open(number: int) -> WalkTrial:
    rng = np.random.default_rng((SEED, 8, number))
    goal = rng.uniform(5, 8) * heading_to_direction(np.array(rng.uniform(-np.pi, np.pi)))
    return WalkTrial(2, "run", np.zeros(2), float(rng.uniform(-np.pi, np.pi)), goal, action="run")


def request(trial: WalkTrial, hold: float = 1.0, **more: Any) -> TakeRequest:
    """Set up one way's take."""
    way = trial.goal - trial.start
    facing = float(np.arctan2(way[0], -way[1]))
    goal = Goal(trial.action, trial.name, np.append(trial.goal, 0.0), facing, hold)
    return TakeRequest(trial.start, trial.heading, [goal], furniture.cuboids(trial.still), **more)


def run_trial(model: Model, trial: WalkTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one way out; returns the take and its figures."""
    asked = request(trial, **more)
    take = yield from rolled(model, asked)
    report, _ = rollout.judge(asked, take, shortest=rollout.shortest_way(asked, trial.goal))
    report |= {"way": float(trial.setting), "ran": float((take.action[:, RUN] > 0.5).mean())}
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over ways; see ``rollout.summarise``.  Those of rooms, holes and runs have their names before
    them.
    """
    out = rollout.summarise(reports)
    for n, name in enumerate(("room", "hole", "run")):
        part = rollout.summarise([r for r in reports if r.get("way", -1) == n])
        out |= {f"{name}_{k}": v for k, v in part.items()}
    return out


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    lines = []
    for name, title in (
        ("room", "walks of 5 m between furniture"),
        ("hole", "walks through a wall with a hole"),
        ("run", "runs in the open"),
    ):
        lines += [
            (f"{title}: reached", f"{s[f'{name}_reached']:.0%}", "", ""),
            (f"{title}: frames deeper than 3 cm", f"{s[f'{name}_deep_share']:.1%}", "", "4 %"),
            (f"{title}: deepest cm (worst)", f"{s[f'{name}_penetration_cm_worst']:.1f}", "", ""),
            (f"{title}: way over the shortest (median)", f"{s[f'{name}_path_ratio_median']:.2f}", "", ""),
        ]
    return [
        *lines[:-3],
        (
            "runs in the open: top speed of the hips m/s (median)",
            f"{s['run_top_speed_m_s_median']:.2f}",
            "",
            "",
        ),
    ]


# --- response ---


@dataclass(frozen=True)
class Order:
    """An order to a standing, walking or running character: ``name`` such as "idle to walk"."""

    setting: int
    name: str
    start: Array
    heading: float
    piece: Furniture | None = None


def orders(starts: int = 10, pool: Pool | None = None, seed: int = SEED) -> list[Order]:
    """Four directions each for walking and running from a stand, ``starts`` each for sitting down out of a
    walk and of a run.
    """
    result = [
        Order(k, f"idle to {a}", np.zeros(2), d * np.pi / 2)
        for k, a in enumerate(("walk", "run"))
        for d in range(4)
    ]
    for k, gait in ((2, "walk"), (3, "run")):
        for n in range(starts):
            rng = np.random.default_rng((seed, 9, n))
            kind = SEATS[n % len(SEATS)]
            piece, _ = rollout.draw_piece(pool, kind, rng)
            room = float(np.linalg.norm(piece.size[:2])) / 2 + 0.5
            while True:
                at = rng.uniform(0.9, 3.0) * heading_to_direction(np.array(rng.uniform(-np.pi, np.pi)))
                heading = float(rng.uniform(-np.pi, np.pi))
                line = at + np.linspace(-LEAD[gait] - 0.3, 4.0, 60)[:, None] * heading_to_direction(
                    np.array(heading)
                )
                if np.linalg.norm(line, axis=1).min() > room:
                    break
            result.append(Order(k, f"{gait} to sit", at, heading, piece))
    return result


def run_order(model: Model, order: Order, **more: Any) -> Trying[tuple[TakeResult | None, Report]]:
    """Give one order and measure the seconds until its label passes 0.9; nan where it never does, or cannot
    be given.
    """
    before, action = order.name.split(" to ")
    ahead = heading_to_direction(np.array(order.heading))
    if order.piece is None:
        # Four directions: where one is sent, seen from where one faces.
        goal = Goal(action, "place", np.append(8 * ahead, 0), order.heading, 0.0)
        runner = TakeRunner(model, TakeRequest(np.zeros(2), 0.0, [goal], Cuboids(), contact_ik=False, **more))
        label, begun = STYLES.index(action), None
        while (yield runner) and runner.frames < _PATIENCE * FPS:
            if runner.director.index == 0 and runner.state.style_past[0, -1, label] > EXECUTED:
                begun = (runner.frames - runner.director.results[0].start_frame) / FPS
                break
        return runner.result(), _answer(order, begun)
    query = furniture.cuboids([(order.piece, np.zeros(2), 0.0)])
    start = order.start - LEAD[before] * ahead
    onward = Goal(before, "place", np.append(order.start + 3.5 * ahead, 0), order.heading, 0.0)
    runner = TakeRunner(model, TakeRequest(start, order.heading, [onward], query, contact_ik=False, **more))
    while (yield runner) and runner.frames < _PATIENCE * FPS:
        if float((runner.state.root[0, :2] - start) @ ahead) >= LEAD[before]:
            break
    moving = float(runner.state.style_past[0, -1, STYLES.index(before)])
    if not hasattr(runner, "interrupt"):
        return runner.result(), _answer(order, None) | {"no_hook": 1.0}
    runner.interrupt([sit_goal(order.piece, np.zeros(2), 0.0)])
    given, begun = runner.frames, None
    while (yield runner) and runner.frames < given + _PATIENCE * FPS:
        if runner.state.style_past[0, -1, SIT] > EXECUTED:
            begun = (runner.frames - given) / FPS
            break
    # Who was not walking or running when told to sit tells nothing about sitting down out of it.
    return runner.result(), _answer(order, begun if moving > 0.5 else None) | {
        "moving_label": moving,
        "reached": float(begun is not None),
    }


def _answer(order: Order, seconds: float | None) -> Report:
    name = order.name.replace(" ", "_")
    return {"reached": float(seconds is not None), f"{name}_s": float("nan") if seconds is None else seconds}


def order_rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    paper = {"idle to walk": "1.49", "idle to run": "0.81", "walk to sit": "4.92", "run to sit": "5.10"}
    return [
        (f"{name} s (mean)", f"{s[name.replace(' ', '_') + '_s_mean']:.2f}", value, "")
        for name, value in paper.items()
    ] + [("orders answered", f"{s['reached']:.0%}", "", "100 %")]


PART = TrialPart(
    "walks between furniture and through holes, runs",
    trials,
    run_trial,
    summarise,
    rows,
    request,
    ("walk", "run"),
)
RESPONSE = TrialPart(
    "seconds from an order until its label passes 0.9",
    orders,
    run_order,
    rollout.summarise,
    order_rows,
    judges=("walk", "run", "sit"),
    travels=False,
)
