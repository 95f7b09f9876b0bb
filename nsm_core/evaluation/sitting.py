"""Sitting trials: fixed starts about seats that no training take has seen, and the figures of every roll-out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import furniture
from ..control.goals import Goal
from ..control.take import TakeRequest, TakeResult, TakeRunner
from ..inference import Model
from ..rotations import Array, heading_to_direction, rotate_planar
from ..seats import find_seat
from ..sensors.cuboid import interaction_sensor
from ..skeleton import HIP_OVER_SEAT
from .metrics import travel_report

SEED = 990_000  # of seats and starts; training draws its furniture from other streams
SEATS = ("chair", "armchair", "stool", "bench", "sofa", "chair")


@dataclass(frozen=True)
class Trial:
    """One start before one seat at the world's origin, facing -Y."""

    seat: int
    piece: furniture.Furniture
    start: Array  # (2,)
    heading: float


def trials(starts: int = 10, seats: int = len(SEATS), furthest: float = 3.0) -> list[Trial]:
    """The same ``starts`` times ``seats`` trials at every call: any direction within ``furthest`` metres, any facing."""
    result = []
    for n in range(seats):
        rng = np.random.default_rng(SEED + n)
        piece = furniture.make(SEATS[n % len(SEATS)], rng)
        lo, hi = piece.mins[:, :2].min(0) - 0.4, piece.maxs[:, :2].max(0) + 0.4
        while len(result) < (n + 1) * starts:
            angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.9, furthest)
            start = distance * heading_to_direction(np.array(angle))
            if ((start > lo) & (start < hi)).all():
                continue
            result.append(Trial(n, piece, start, float(rng.uniform(-np.pi, np.pi))))
    return result


def request(
    trial: Trial, hold: float = 1.0, contact_ik: bool = True, place: Array | None = None, turn: float = 0.0, **more: object
) -> TakeRequest:
    """Set up one trial's take: the seat is found from its mesh, as in Blender."""
    piece = trial.piece
    place = np.zeros(2) if place is None else place
    seat = find_seat(piece.vertices, piece.triangles)
    query = furniture.cuboids([(piece, place, turn)])
    centre = np.append(place + rotate_planar(piece.centre[:2], np.float64(turn)), piece.centre[2])
    volume = interaction_sensor(query, centre, piece.size, turn)
    hips = np.append(place + rotate_planar(seat.point[:2], np.float64(turn)), seat.point[2] + HIP_OVER_SEAT)
    goal = Goal("sit", piece.kind, hips, seat.heading + turn, hold, volume)
    return TakeRequest(
        place + rotate_planar(trial.start, np.float64(turn)), trial.heading + turn, [goal], query, contact_ik=contact_ik, **more
    )  # type: ignore[arg-type]


def run_trial(model: Model, trial: Trial, **more: object) -> tuple[TakeResult, dict[str, float]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)  # type: ignore[arg-type]
    runner = TakeRunner(model, asked)
    while runner.step():
        pass
    result = runner.result()
    report = travel_report(result.hips_position, result.local_rotations, result.action, query=asked.environment)
    alone = travel_report(result.network_hips, result.network_rotations, result.action)
    goal = result.goals[0]
    report |= {
        "reached": float(goal.reached),
        "seconds": goal.seconds,
        "pe_cm": goal.position_error_cm,
        "re_deg": goal.rotation_error_deg,
        "network_pe_cm": goal.network_position_error_cm,
        "network_re_deg": goal.network_rotation_error_deg,
        "network_slide_moving_cm_s": alone["slide_moving_cm_s"],
        "network_planted_share": alone["planted_share"],
        "ms_per_frame": sum(result.stage_ms.values()),
    }
    return result, report


def summarise(reports: list[dict[str, float]]) -> dict[str, float]:
    """Means and counts over trials; errors over the trials that ended, success by the issue's measures."""
    table = {k: np.array([r.get(k, np.nan) for r in reports], dtype=float) for k in reports[0]}
    reached = table["reached"] > 0
    alone = reached & (table["network_pe_cm"] < 10) & (table["network_re_deg"] < 10)
    precise = reached & (table["pe_cm"] < 3) & (table["re_deg"] < 3)
    summary = {
        "trials": len(reports),
        "reached": reached.mean(),
        "within_10cm_10deg_alone": alone.mean(),
        "within_3cm_3deg_ik": precise.mean(),
    }
    for k, v in table.items():
        if k != "reached":
            good = v[np.isfinite(v)]
            summary[f"{k}_median"] = float(np.median(good)) if len(good) else float("nan")
            summary[f"{k}_worst"] = float(good.min() if "planted" in k and len(good) else good.max()) if len(good) else float("nan")
    return {k: float(v) for k, v in summary.items()}


def run_all(
    model: Model, chosen: list[Trial], progress: Callable[[int, int], None] | None = None, **more: object
) -> tuple[list[TakeResult], list[dict[str, float]]]:
    """Run trials one after the other."""
    takes, reports = [], []
    for n, trial in enumerate(chosen):
        take, report = run_trial(model, trial, **more)
        takes.append(take)
        reports.append(report)
        if progress:
            progress(n + 1, len(chosen))
    return takes, reports
