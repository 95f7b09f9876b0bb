"""Sitting trials: fixed starts about seats that no training take has seen, and the figures of every
roll-out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene import furniture

from ..furniture_goals import sit_goal
from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

SEATS = ("chair", "armchair", "stool", "bench", "sofa", "chair")
AT_TABLE = ("chair", "stool")
# Metres from the seated hips to the edge of the table that the seat stands partly under.
TO_EDGE = (0.26, 0.36)


@dataclass(frozen=True)
class SitTrial:
    """One start before one seat at the world's origin, facing -Y; ``others`` (furniture, place, heading)
    stand about it.

    A seat with ``known`` is taken where the piece says it is, one without is found from its mesh, as in
    Blender.  Who ``leaves`` walks back to the start in the end.
    """

    seat: int
    piece: furniture.Furniture
    start: Array  # (2,)
    heading: float
    others: tuple[tuple[furniture.Furniture, Array, float], ...] = ()
    known: bool = False
    leaves: bool = False

    @property
    def setting(self) -> int:
        """Number of the seat."""
        return self.seat

    @property
    def name(self) -> str:
        """Kind of the seat."""
        return self.piece.kind


def trials(
    starts: int = 10,
    settings: int = len(SEATS),
    furthest: float = 3.0,
    pool: Pool | None = None,
    seed: int = SEED,
) -> list[SitTrial]:
    """Of one ``seed`` the same ``starts`` times ``settings`` trials at every call: any direction within
    ``furthest`` metres, any facing.

    With a ``pool`` (the held-back part of one) the seats are its meshes, scaled as in training.
    """
    result: list[SitTrial] = []
    for n in range(settings):
        rng = np.random.default_rng(seed + n)
        kind = SEATS[n % len(SEATS)]
        piece, known = rollout.draw_piece(pool, kind, rng)
        lo, hi = piece.mins[:, :2].min(0) - 0.4, piece.maxs[:, :2].max(0) + 0.4
        while len(result) < (n + 1) * starts:
            angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.9, furthest)
            start = distance * heading_to_direction(np.array(angle))
            if ((start > lo) & (start < hi)).all():
                continue
            result.append(SitTrial(n, piece, start, float(rng.uniform(-np.pi, np.pi)), known=known))
    return result


def trials_at_tables(
    starts: int = 10, settings: int = len(AT_TABLE), pool: Pool | None = None
) -> list[SitTrial]:
    """Trials on seats that stand partly under a table, so that one has to get in from the side, and out
    again.
    """
    result: list[SitTrial] = []
    for n in range(settings):
        rng = np.random.default_rng((SEED, 5, n))
        kind = AT_TABLE[n % len(AT_TABLE)]
        piece, known = rollout.draw_piece(pool, kind, rng)
        others = (table_over(piece, rng),)
        free = rollout.clear_of(furniture.cuboids([(piece, np.zeros(2), 0.0), *others]))
        for _ in range(starts):
            start, heading = rollout.start_about(rng, np.zeros(2), free)
            result.append(SitTrial(n, piece, start, heading, others, known, leaves=True))
    return result


def table_over(
    piece: furniture.Furniture, rng: np.random.Generator
) -> tuple[furniture.Furniture, Array, float]:
    """A table that a seat stands partly under, and its place (2,) and heading in the seat's frame."""
    seat = piece.require_seat()
    table = furniture.make(
        "table",
        rng,
        width=rng.uniform(0.9, 1.5),
        depth=rng.uniform(0.6, 0.8),
        height=rng.uniform(0.72, 0.78),
        legs="posts",
    )
    edge = seat.point[1] - rng.uniform(*TO_EDGE) - float(table.size[1]) / 2
    return table, np.array((seat.point[0], edge)), 0.0


def request(
    trial: SitTrial,
    hold: float = 1.0,
    contact_ik: bool = True,
    place: Array | None = None,
    turn: float = 0.0,
    **more: Any,
) -> TakeRequest:
    """Set up one trial's take, the whole scene moved to ``place`` (2,) and turned by ``turn`` radians."""
    place = np.zeros(2) if place is None else place
    angle = np.float64(turn)
    others = [
        (f, place + rotate_planar(np.asarray(at)[:2], angle), heading + turn)
        for f, at, heading in trial.others
    ]
    query = furniture.cuboids([(trial.piece, place, turn), *others])
    goal = sit_goal(trial.piece, place, turn, trial.known, hold)
    start = place + rotate_planar(trial.start, angle)
    goals = (
        [goal, Goal("walk", "the start", np.append(start, 0), trial.heading + turn, 0.5)]
        if trial.leaves
        else [goal]
    )
    return TakeRequest(start, trial.heading + turn, goals, query, contact_ik=contact_ik, **more)


def run_trial(model: Model, trial: SitTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)
    take = yield from rolled(model, asked)
    report, depths = rollout.judge(asked, take)
    if trial.leaves:
        report["left"] = float(take.goals[1].reached)
        report["penetration_end_cm"] = 100 * float(depths[take.goals[1].start_frame - 1])
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``.  Success by the issue's measures and by those of later
    work.
    """
    return rollout.summarise(reports) | {
        "within_10cm_10deg_alone": rollout.share(
            reports, lambda r: r["reached"] and r["network_pe_cm"] < 10 and r["network_re_deg"] < 10
        ),
        "within_3cm_3deg_ik": rollout.share(
            reports, lambda r: r["reached"] and r["pe_cm"] < 3 and r["re_deg"] < 3
        ),
        "success": rollout.share(
            reports,
            lambda r: (
                r["reached"] and r["pe_cm"] < 20 and r["penetration_end_cm"] <= 5 and r["seconds"] <= 20
            ),
        ),
    }


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    left = [("left again for the start", f"{s['left_mean']:.0%}", "", "")] if "left_mean" in s else []
    return [
        (
            "sit, reached within 20 s, PE < 20 cm, end free of penetration",
            f"{s['success']:.0%}",
            "99.6 % (TokenHSI)",
            "97 %",
        ),
        ("reached, network alone within 10 cm and 10 deg", f"{s['within_10cm_10deg_alone']:.0%}", "", "80 %"),
        ("reached, with contact IK within 3 cm and 3 deg", f"{s['within_3cm_3deg_ik']:.0%}", "", "80 %"),
        (
            "sit PE cm, network alone (mean / median)",
            f"{s['network_pe_cm_mean']:.2f} / {s['network_pe_cm_median']:.2f}",
            "2.93",
            "2.9",
        ),
        (
            "sit RE deg, network alone (mean / median)",
            f"{s['network_re_deg_mean']:.2f} / {s['network_re_deg_median']:.2f}",
            "0.92",
            "0.9",
        ),
        (
            "sit PE cm, with contact IK (mean / median)",
            f"{s['pe_cm_mean']:.2f} / {s['pe_cm_median']:.2f}",
            "",
            "1",
        ),
        (
            "sit RE deg, with contact IK (mean / median)",
            f"{s['re_deg_mean']:.2f} / {s['re_deg_median']:.2f}",
            "",
            "0.5",
        ),
        ("seconds to sit (median)", f"{s['seconds_median']:.2f}", "4.92", ""),
        ("times seated per take (worst)", f"{s['sit_count_worst']:.0f}", "", "1"),
        *left,
    ]


PART = TrialPart(
    "sit, on seats not seen in training",
    lambda starts, pool: trials(starts, pool=pool),
    run_trial,
    summarise,
    rows,
    request,
    ("sit",),
    {
        "no bi-directional control": ("4.27", "1.58"),
        "interaction sensor zeroed": ("3.72 (retrained)", "1.11 (retrained)"),
        "environment sensor zeroed": ("3.05 (retrained)", "0.94 (retrained)"),
    },
)
AT_TABLES = TrialPart(
    "sit, on seats partly under a table",
    lambda starts, pool: trials_at_tables(starts, pool=pool),
    run_trial,
    summarise,
    rows,
    request,
    ("sit",),
)
