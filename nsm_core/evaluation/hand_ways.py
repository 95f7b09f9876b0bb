"""Planned ways of hands judged on kitchens that were not learnt from: the planner beside what needs no
learning (papers/002 table 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np

from nsm_core.control.hand_plan import LikeWay, known_fields, plan_way
from nsm_core.conventions import FPS
from nsm_core.data.reaches.library import WayLibrary
from nsm_core.model.inference.field_model import FieldModel
from nsm_core.model.networks.field_numpy import seen_of
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import CELL, NEAREST, SIDE, grid_around
from nsm_core.world.planning.hand_way import timed

CLEAR = 0.03  # metres of a wrist to anything under which a way has failed
AROUND = 0.2  # metres around the end of a way within which its room counts
_PACE = 0.9  # m/s of ways that are not planned


@dataclass(frozen=True)
class Judged:
    """Of ways: share that touch nothing and arrive; metres of room around the thing, mean of those; jerk of
    the wrist, m/s3, mean; seconds of the processor.
    """

    success: float
    room: float
    jerk: float
    seconds: float


def judge(model: FieldModel, library: WayLibrary, rows: Array, learnt: Array) -> dict[str, Judged]:
    """Plan the ways ``rows`` of a library, with those of ``learnt`` to liken them to; by name of method."""
    points = grid_around(np.zeros(3))
    seen = _seen(library, learnt)
    found: dict[str, list[tuple[Array, bool, float]]] = {"planner": [], "straight": [], "made": []}
    for row in rows:
        path = library.path[row, -library.length[row] :].astype(np.float64)
        like = _like(library, row, learnt, seen, path[-1])
        target, obstacles = (f[row].astype(np.float32) for f in (library.target, library.obstacles))
        condition = library.condition[row]
        begun = process_time()
        known = known_fields(points, target, obstacles, like)
        plan = plan_way(model, known, condition, path[0], like)
        found["planner"].append((plan.path, plan.arrived, process_time() - begun))
        begun = process_time()
        straight = timed(np.stack((path[0], path[-1])), _PACE)
        found["straight"].append((straight, True, process_time() - begun))
        found["made"].append((path, True, 0.0))
    return {name: _judged(library, rows, ways) for name, ways in found.items()}


def table(judged: dict[str, Judged]) -> str:
    """The same as text."""
    lines = ["| ways | success | room, cm | jerk, m/s3 | seconds |", "|" + 5 * "---|"]
    for name, j in judged.items():
        lines.append(f"| {name} | {j.success:.0%} | {100 * j.room:.1f} | {j.jerk:.0f} | {j.seconds:.2f} |")
    return "\n".join(lines)


def _seen(library: WayLibrary, rows: Array) -> Array:
    known = (library.target[rows].astype(np.float32), library.obstacles[rows].astype(np.float32))
    ones = np.ones(library.condition.shape[1])
    return seen_of(*known, library.condition[rows], np.full(2, 1 / NEAREST), ones)


def _like(library: WayLibrary, row: int, learnt: Array, seen: Array, end: Array) -> LikeWay:
    """The learnt way whose scene is most like that of ``row`` under the same hand and load, moved to end at
    ``end`` (3,).
    """
    same = (library.condition[learnt, 1:] == library.condition[row, 1:]).all(1)
    off = np.linalg.norm(seen - _seen(library, np.array([row]))[0], axis=1) + np.where(same, 0, 1e6)
    best = learnt[int(off.argmin())]
    path = library.path[best, -library.length[best] :].astype(np.float64)
    return LikeWay(path - path[-1] + end, np.repeat(library.rotation[best][None], len(path), 0))


def _judged(library: WayLibrary, rows: Array, ways: list[tuple[Array, bool, float]]) -> Judged:
    success, room, jerk = [], [], []
    for row, (path, arrived, _) in zip(rows, ways, strict=True):
        free = 1 / np.maximum(_at(library.obstacles[row].astype(np.float64), path), 1e-3)
        good = arrived and float(free[:-3].min()) > CLEAR
        success.append(good)
        if good:
            near = np.linalg.norm(path - path[-1], axis=1) < AROUND
            room.append(float(free[near].mean()))
        jerk.append(float(np.linalg.norm(np.diff(path, 3, axis=0), axis=1).mean() * FPS**3))
    seconds = float(np.mean([seconds for *_, seconds in ways]))
    return Judged(float(np.mean(success)), float(np.mean(room or [0.0])), float(np.mean(jerk)), seconds)


def _at(values: Array, places: Array) -> Array:
    """A field (N, N, N) around the origin at places (P, 3), between cells trilinear, at its edge beyond."""
    at = np.clip((places + SIDE / 2) / CELL - 0.5, 0, values.shape[0] - 1.001)
    low = at.astype(int)
    part = at - low
    out = np.zeros(len(places))
    for corner in np.ndindex(2, 2, 2):
        share = np.prod(np.where(corner, part, 1 - part), axis=1)
        i, j, k = (low + corner).T
        out += share * values[i, j, k]
    return out
