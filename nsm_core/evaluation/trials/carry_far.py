"""Carrying trials that are hard to stand at: boxes far from the edges of tables, cabinets and shelves, and a
crate of the largest size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nsm_core.control.take import TakeResult
from nsm_core.evaluation.measures.motion import DEEP
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture

from . import carry, rollout
from .carry import CarryTrial
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying

# Name, size of the box, what it stands on and goes to: kind, height of that top, and metres from the edge to
# the box; metres.
SETTINGS: tuple[
    tuple[str, tuple[float, float, float], tuple[str, float, float], tuple[str, float, float]], ...
] = (
    ("table 25 cm to table 5 cm", (0.34, 0.3, 0.26), ("table", 0.72, 0.25), ("table", 0.75, 0.05)),
    ("floor to table 20 cm", (0.3, 0.3, 0.3), ("floor", 0.0, 0.0), ("table", 0.74, 0.2)),
    ("table 8 cm to floor", (0.4, 0.32, 0.24), ("table", 0.75, 0.08), ("floor", 0.0, 0.0)),
    ("table 15 cm to shelf's top", (0.34, 0.28, 0.24), ("table", 0.7, 0.15), ("shelf", 1.1, 0.05)),
    ("floor to shelf's inner board", (0.32, 0.26, 0.26), ("floor", 0.0, 0.0), ("inner", 0.78, 0.05)),
    ("table 18 cm to cabinet 15 cm", (0.32, 0.26, 0.24), ("table", 0.78, 0.18), ("cabinet", 0.95, 0.15)),
    ("cabinet 12 cm to floor", (0.36, 0.3, 0.28), ("cabinet", 0.9, 0.12), ("floor", 0.0, 0.0)),
    ("low table 20 cm to cabinet 10 cm", (0.3, 0.3, 0.25), ("table", 0.45, 0.2), ("cabinet", 0.85, 0.1)),
    ("crate of 0.6 m, floor to floor", (0.6, 0.6, 0.6), ("floor", 0.0, 0.0), ("floor", 0.0, 0.0)),
    (
        "crate of 0.5 m, table 12 cm to table 18 cm",
        (0.5, 0.4, 0.35),
        ("table", 0.6, 0.12),
        ("table", 0.72, 0.18),
    ),
)


def inner_shelf(rng: np.random.Generator, board: float, width: float, depth: float, room: float) -> Furniture:
    """A shelf open at the front whose board at height ``board`` has ``room`` metres to the one over it."""
    t = 0.025
    x, y, top = width / 2, depth / 2, board + room + 2 * t
    boxes = [(-x, -x + t, -y, y, 0, top), (x - t, x, -y, y, 0, top), (-x + t, x - t, y - 0.01, y, 0, top)]
    heights = (0.05, 0.5 * board, board - t, board + room)
    return furniture.build("shelf", boxes + [(-x + t, x - t, -y, y - 0.01, z, z + t) for z in heights])


def support_far(
    rng: np.random.Generator,
    kind: str,
    height: float,
    edge: float,
    crate: Furniture,
    centre: Array,
    facing: float,
) -> list[tuple[Furniture, Array, float]]:
    """What stands under a box at ``centre`` (2,) that is taken or put by one who faces ``facing``, its near
    face ``edge`` metres in.
    """
    if kind == "floor":
        return []
    depth = float(crate.size[1])
    if kind == "inner":
        piece = inner_shelf(
            rng, height, float(crate.size[0]) + 0.35, depth + edge + 0.1, float(crate.size[2]) + 0.12
        )
    else:
        # So that the other side is no nearer.
        deep = max(0.35 if kind == "shelf" else 0.7, depth + 2 * edge + 0.1)
        piece = furniture.make(kind, rng, width=float(rng.uniform(0.9, 1.4)), depth=deep, height=height)
    inner = np.array((0.0, float(piece.mins[:, 1].min()) + edge + depth / 2))
    turn = facing + np.pi
    place = np.asarray(centre, dtype=np.float64)[:2] - rotate_planar(inner, np.float64(turn))
    return [(piece, place, float(turn))]


def trials(starts: int = 1, settings: Sequence[int] = range(len(SETTINGS))) -> list[CarryTrial]:
    """The same ``starts`` of each of ``settings`` at every call."""
    result = []
    for n in settings:
        name, size, source, destination = SETTINGS[n]
        rng = np.random.default_rng((SEED, 3, n))
        crate = furniture.make("crate", rng, width=size[0], depth=size[1], height=size[2])
        turn = float(rng.uniform(-np.pi, np.pi))
        still = support_far(rng, *source, crate, np.zeros(2), turn)
        box = np.array((0, 0, source[1] + size[2] / 2, turn + np.pi))
        way = turn + np.pi + float(rng.uniform(-0.7, 0.7))
        facing = way + float(rng.uniform(-0.5, 0.5))
        place = rng.uniform(2.4, 3.0) * heading_to_direction(np.array(way))
        more = support_far(rng, *destination, crate, place, facing)
        goal = np.array((*place, destination[1] + size[2] / 2, facing))
        pieces = tuple(still + more)
        free = rollout.clear_of(furniture.cuboids(pieces), [carry.box_at(crate, box)])
        for _ in range(starts):
            start, heading = rollout.start_about(rng, np.zeros(2), free)
            result.append(CarryTrial(n, name, start, heading, crate, box, goal, facing, pieces))
    return result


def run_trial(model: Model, trial: CarryTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures, those of ``carrying`` and whether it was
    ``sound``.

    Sound: placed, the body deeper than 3 cm in at most 3 % of the frames, and the box nowhere deeper than 1
    cm in anything.
    """
    take, report = yield from carry.run_trial(model, trial, **more)
    report["sound"] = float(
        report["placed"] > 0 and report["penetration_share"] <= DEEP and report["box_in_solids_cm"] <= 1
    )
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``carry.summarise``."""
    return carry.summarise(reports) | {"sound": rollout.share(reports, lambda r: r["sound"] > 0)}


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [("carry from far off an edge, sound", f"{s['sound']:.0%}", "", "100 %"), *carry.rows(s)]


PART = TrialPart(
    "carry, boxes far from edges, onto shelves, and large ones",
    lambda starts, pool: trials(starts),
    run_trial,
    summarise,
    rows,
    carry.request,
    ("carry",),
    done="sound",
)
