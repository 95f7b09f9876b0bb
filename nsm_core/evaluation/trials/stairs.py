"""Stairs: flights of 3 to 12 steps on the way, up and down, with feet on the treads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.skeleton import ANKLE_HEIGHT, forward_kinematics
from nsm_core.control.goals import Goal
from nsm_core.control.request import TakeRequest, TakeResult
from nsm_core.conventions import FPS
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array
from nsm_core.signals import intervals
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import cuboids
from nsm_core.world.scene.furniture.flight import flight_piece
from nsm_core.world.scene.stairs import Flight, Stairs
from nsm_core.world.scene.terrain import CELL, HeightMap

from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

STEPS = (3, 5, 8, 12)
AHEAD, ASIDE = 2.6, 0.6  # metres of the landing ahead of a flight, and that it is wider to either side
NEAR = 0.35  # metres from the goal that count as there
STILL, SHORTEST = 0.12, 4  # m/s of a foot that stands, and frames of a stand at least
ON_TREAD = 0.03  # metres that an ankle may be off its height over a tread
DEEP = 10.0  # centimetres that a body may be inside the flight


@dataclass(frozen=True)
class StairTrial:
    """One start before a flight, or on its landing, at the world's origin."""

    setting: int
    name: str
    start: Array
    heading: float
    flight: Flight
    up: bool


def trials(starts: int = 10, settings: int = 2 * len(STEPS), pool: Pool | None = None) -> list[StairTrial]:
    """The same ``starts`` times ``settings`` trials at every call; flights are made, never drawn from a
    ``pool``.
    """
    result = []
    for n in range(settings):
        steps, up = STEPS[(n // 2) % len(STEPS)], n % 2 == 0
        rng = np.random.default_rng((SEED, 11, n))
        for _ in range(starts):
            flight = Flight(
                np.zeros(2),
                float(rng.uniform(-np.pi, np.pi)),
                float(rng.uniform(0.9, 1.6)),
                float(rng.uniform(0.25, 0.31)),
                float(rng.uniform(0.14, 0.2)),
                steps,
            )
            side = float(rng.uniform(-0.5, 0.5))
            along = -float(rng.uniform(1.0, 2.5)) if up else flight.length + float(rng.uniform(0.9, 1.9))
            heading = flight.heading + (0.0 if up else np.pi) + float(rng.uniform(-1.2, 1.2))
            name = f"{steps} steps {'up' if up else 'down'}"
            result.append(StairTrial(n, name, flight.at(along, side), heading, flight, up))
    return result


def stairs_of(flight: Flight) -> Stairs:
    """A flight with the landing that ``flight_piece`` gives it."""
    wide = flight.width / 2 + ASIDE
    across, ahead = np.arange(-wide + CELL / 2, wide, CELL), np.arange(CELL / 2, AHEAD, CELL)
    origin = flight.at(flight.length + float(ahead[-1]), float(across[0]))
    landing = HeightMap(origin, flight.heading, np.full((len(across), len(ahead)), flight.base + flight.rise))
    return Stairs((flight,), (landing,))


def request(trial: StairTrial, hold: float = 0.5, **more: Any) -> TakeRequest:
    """Set up one trial's take: up as a climb, down as a walk."""
    flight = trial.flight
    piece = flight_piece(flight, (AHEAD, ASIDE))
    query = cuboids([(piece, flight.foot, flight.heading + np.pi)])
    if trial.up:
        place = np.append(flight.at(flight.length + 1.3), flight.rise)
        goal = Goal("climb", "Stairs", place, flight.heading, hold)
    else:
        goal = Goal("walk", "Place", np.append(flight.at(-1.5), 0.0), flight.heading + np.pi, hold)
    return TakeRequest(trial.start, trial.heading, [goal], query, stairs=stairs_of(flight), **more)


def on_treads(positions: Array, flight: Flight) -> tuple[int, int]:
    """How many stands on a flight have their ankle over a tread and at its height, and how many there are;
    joints (T, 23, 3), world metres.
    """
    good = count = 0
    for ankle, toe in zip(ANKLES, TOES, strict=True):
        speed = np.linalg.norm(np.gradient(positions[:, toe].astype(np.float64), axis=0), axis=1) * FPS
        for a, b in intervals(speed < STILL):
            own = flight.local(np.median(positions[a:b, toe, :2], axis=0))
            if b - a < SHORTEST or not 0 < own[0] < flight.length:
                continue
            count += 1
            # When it has come down whole, before its heel is raised.
            place = positions[a : a + max(1, (b - a) // 2), ankle].min(0).astype(np.float64)
            under = float(flight.heights(flight.local(place[:2])[:1])[0])
            good += abs(float(place[2]) - ANKLE_HEIGHT - under) < ON_TREAD
    return good, count


def run_trial(model: Model, trial: StairTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)
    take = yield from rolled(model, asked)
    ground = asked.stairs.heights
    report, _ = rollout.judge(asked, take, ground=ground)
    positions = forward_kinematics(take.hips_position, take.local_rotations)[0]
    good, count = on_treads(positions, trial.flight)
    off = float(np.linalg.norm(take.root[-1, :2] - asked.goals[0].position[:2]))
    report |= {
        "end_off_cm": 100 * off,
        "stands": float(count),
        "on_treads": good / count if count else float("nan"),
        "up": float(trial.up),
    }
    done = bool(report["reached"]) and off < NEAR and report["penetration_cm"] <= DEEP
    report["passed"] = float(done)
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return rollout.summarise(reports) | {
        f"passed_{name}": rollout.share([r for r in reports if r.get("up") == up], lambda r: r["passed"])
        for name, up in (("up", 1.0), ("down", 0.0))
    }


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [
        ("passed going up, and not through the flight", f"{s['passed_up']:.0%}", "", "95 %"),
        ("passed going down", f"{s['passed_down']:.0%}", "", "95 %"),
        (
            "stands with the ankle over a tread and at its height, to 3 cm (mean share)",
            f"{s['on_treads_mean']:.0%}",
            "",
            "95 %",
        ),
        (
            "root off its place cm (median / worst)",
            f"{s['end_off_cm_median']:.1f} / {s['end_off_cm_worst']:.1f}",
            "",
            "",
        ),
        ("seconds (median)", f"{s['seconds_median']:.1f}", "", ""),
    ]


PART = TrialPart(
    "stairs",
    lambda starts, pool: trials(starts, pool=pool),
    run_trial,
    summarise,
    rows,
    request,
    ("climb", "walk"),
    done="passed",
)
