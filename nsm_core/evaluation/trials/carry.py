"""Carrying trials: boxes on the floor, on low and on usual tables, to a place on the floor or on another
table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.evaluation.measures.objects import box_report
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.assets.pool import Pool, scaled
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture, carried_box
from nsm_core.world.scene.props import Box

from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

FLOOR, LOW, TABLE = 0.0, (0.35, 0.5), (0.68, 0.78)
SETTINGS = (
    ("floor to floor", FLOOR, FLOOR),
    ("floor to table", FLOOR, TABLE),
    ("low table to floor", LOW, FLOOR),
    ("low table to table", LOW, TABLE),
    ("table to floor", TABLE, FLOOR),
    ("table to table", TABLE, TABLE),
)
SIDES = (0.24, 0.42)  # of the boxes, metres: within those of training
EDGE = 0.03  # metres from a table's edge to the box
PLACED = 5.0  # cm from its destination within which a box counts as placed


@dataclass(frozen=True)
class CarryTrial:
    """One start before one box; pieces are (furniture, place, heading) in the world, ``box`` (4,) and
    ``goal`` (4,) box centres.
    """

    setting: int
    name: str
    start: Array
    heading: float
    crate: Furniture
    box: Array
    goal: Array
    facing: float
    still: tuple[tuple[Furniture, Array, float], ...]


def make_crate(rng: np.random.Generator, pool: Pool | None) -> Furniture:
    # The footprint is nearly square, so that a place on a table serves from whichever side the box is taken.
    side = rng.uniform(*SIDES)
    size = np.array((side + rng.uniform(-0.02, 0.02), side + rng.uniform(-0.02, 0.02), rng.uniform(*SIDES)))
    if pool is not None and pool.of_kind("crate"):
        piece = pool.draw("crate", rng)
        return scaled(piece, size / piece.size, "crate")
    return furniture.make("crate", rng, width=float(size[0]), depth=float(size[1]), height=float(size[2]))


def support(
    rng: np.random.Generator,
    height: object,
    crate: Furniture,
    centre: Array,
    facing: float,
    pool: Pool | None,
) -> tuple[float, list[tuple[Furniture, Array, float]]]:
    """A table under a box at ``centre`` (2,) that is reached by one who faces ``facing``: height of its top,
    and the table.
    """
    if not isinstance(height, tuple):
        return 0.0, []
    wanted = float(rng.uniform(*height))
    if pool is not None and pool.of_kind("table"):
        table = pool.draw("table", rng, augment=False)
        top, corners = furniture.top_of(table)
        table = scaled(
            table, np.array((min(1.0, 1.6 / table.size[0]), min(1.0, 1.0 / table.size[1]), wanted / top))
        )
        top, corners = furniture.top_of(table)
    else:
        table = furniture.make("table", rng, height=wanted, width=float(rng.uniform(0.8, 1.4)))
        top, corners = furniture.top_of(table)
    # The front edge (-Y) of the table is the one before the carrier, so the table faces against ``facing``.
    depth = float(max(crate.size[:2]))
    inner = np.array(((corners[0, 0] + corners[1, 0]) / 2, corners[0, 1] + EDGE + depth / 2))
    turn = facing + np.pi
    place = np.asarray(centre, dtype=np.float64)[:2] - rotate_planar(inner, np.float64(turn))
    return float(top), [(table, place, float(turn))]


def trials(
    starts: int = 10, settings: int = len(SETTINGS), pool: Pool | None = None, seed: int = SEED
) -> list[CarryTrial]:
    """Of one ``seed`` the same ``starts`` times ``settings`` trials at every call, about boxes that training
    has not seen; ``pool`` held back.
    """
    result = []
    for n in range(settings):
        name, source, destination = SETTINGS[n % len(SETTINGS)]
        rng = np.random.default_rng((seed, 1, n))
        crate = make_crate(rng, pool)
        # Where one who lifts the box looks when it stands on a table.
        turn = float(rng.uniform(-np.pi, np.pi))
        top, still = support(rng, source, crate, np.zeros(2), turn, pool)
        box = np.array((0, 0, top + crate.size[2] / 2, turn))
        # The destination lies behind the one who lifts, so that the way is a turn with the box and free of
        # its table.
        way = turn + np.pi + float(rng.uniform(-0.7, 0.7))
        facing = way + float(rng.uniform(-0.5, 0.5))
        place = rng.uniform(2.4, 3.0) * heading_to_direction(np.array(way))
        top, more = support(rng, destination, crate, place, facing, pool)
        goal = np.array((*place, top + crate.size[2] / 2, facing))
        stands = tuple(still + more)
        free = rollout.clear_of(furniture.cuboids(stands), [box_at(crate, box)])
        rng = np.random.default_rng((seed, 2, n))
        for _ in range(starts):
            start, heading = rollout.start_about(rng, np.zeros(2), free)
            result.append(CarryTrial(n, name, start, heading, crate, box, goal, facing, stands))
    return result


def box_at(crate: Furniture, pose: Array) -> Box:
    """The crate as a box whose centre is at ``pose``."""
    return carried_box(crate, pose - np.append(rotate_planar(crate.centre, np.float64(pose[3])), 0.0))


def request(trial: CarryTrial, hold: float = 1.0, **more: Any) -> TakeRequest:
    """Set up one trial's take."""
    goal = Goal("carry", "Box", trial.goal[:3], trial.facing, hold, prop=box_at(trial.crate, trial.box))
    return TakeRequest(trial.start, trial.heading, [goal], furniture.cuboids(trial.still), **more)


def run_trial(model: Model, trial: CarryTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)
    take = yield from rolled(model, asked)
    report, _ = rollout.judge(asked, take)
    box = asked.goals[0].prop
    assert isinstance(box, Box)
    poses = take.props[box.name]
    report |= box_report(box, poses, take.hips_position, take.local_rotations, asked.environment, trial.goal)
    report["placed"] = float(bool(report["reached"]) and report["box_error_cm"] <= PLACED)
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return rollout.summarise(reports) | {
        "placed": rollout.share(reports, lambda r: r["placed"] > 0),
        "moved": rollout.share(reports, lambda r: r["box_moved"] > 0),
        "success": rollout.share(reports, lambda r: r["placed"] > 0 and r["penetration_end_cm"] <= 5),
    }


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [
        ("carry, placed within 5 cm", f"{s['placed']:.0%}", "", "92 %"),
        (
            "carry, placed, no penetration over 5 cm at the end",
            f"{s['success']:.0%}",
            "92.2 % (TokenHSI)",
            "",
        ),
        (
            "carry PE cm, hands at the grasp, network alone (mean)",
            f"{s['network_hand_pe_cm_mean']:.2f}",
            "3.05",
            "3.0",
        ),
        (
            "carry RE deg, hands at the grasp, network alone (mean)",
            f"{s['network_hand_re_deg_mean']:.2f}",
            "1.02",
            "1.0",
        ),
        ("carry PE cm, with contact IK (mean)", f"{s['hand_pe_cm_mean']:.2f}", "", "1"),
        ("carry RE deg, with contact IK (mean)", f"{s['hand_re_deg_mean']:.2f}", "", "0.5"),
        (
            "box off its destination cm (median / worst)",
            f"{s['box_error_cm_median']:.1f} / {s['box_error_cm_worst']:.1f}",
            "",
            "5",
        ),
        (
            "box turned off deg (median / worst)",
            f"{s['box_turn_deg_median']:.1f} / {s['box_turn_deg_worst']:.1f}",
            "",
            "",
        ),
        (
            "hands off the grasps while carrying cm (median / worst)",
            f"{s['hands_off_cm_median']:.1f} / {s['hands_off_worst_cm_worst']:.1f}",
            "",
            "",
        ),
        (
            "line of the hands off level deg (median / worst)",
            f"{s['hands_tilt_deg_median']:.0f} / {s['hands_tilt_deg_worst']:.0f}",
            "",
            "",
        ),
        (
            "box moves without hands cm (median / worst)",
            f"{s['box_unheld_cm_median']:.1f} / {s['box_unheld_cm_worst']:.1f}",
            "",
            "0",
        ),
        (
            "largest change of the box's step cm (median / worst)",
            f"{s['box_jolt_cm_median']:.1f} / {s['box_jolt_cm_worst']:.1f}",
            "",
            "",
        ),
        (
            "box inside solids cm (median / worst)",
            f"{s['box_in_solids_cm_median']:.1f} / {s['box_in_solids_cm_worst']:.1f}",
            "",
            "0",
        ),
        ("seconds to carry (median)", f"{s['seconds_median']:.1f}", "", ""),
    ]


PART = TrialPart(
    "carry", lambda starts, pool: trials(starts, pool=pool), run_trial, summarise, rows, request, ("carry",),
    {
        "no bi-directional control": ("3.41", "1.73"),
        "interaction sensor zeroed": ("6.09 (retrained)", "2.26 (retrained)"),
        "environment sensor zeroed": ("8.52 (retrained)", "2.27 (retrained)"),
    },
    alone="network_hand", done="placed",
)  # fmt: skip
