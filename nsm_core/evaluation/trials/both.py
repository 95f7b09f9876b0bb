"""Pick and place trials of two things: in kitchens by seed, from one open board to places near each other,
carried at once where that is quicker; and the same one after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import thing_in_solids
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.geometry.distance import Union
from nsm_core.world.scene.props import LightThing

from . import place, rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

_NEAR = 0.9  # metres between the two places at most
_TRIES = 30


@dataclass(frozen=True)
class BothTrial(place.PlaceTrial):
    """A trial of ``place`` with a second thing ``also`` and where (3,) that is put."""

    also: str
    there: Array


def trials(kitchens: int = 10) -> list[BothTrial]:
    """The same trials at every call: one in each of so many kitchens that have two such things."""
    made = (_trial(seed) for seed in range(place.FIRST, place.FIRST + kitchens))
    return [one for one in made if one is not None]


def _trial(seed: int) -> BothTrial | None:
    kitchen = make_kitchen(seed)
    rng = np.random.default_rng((SEED, 17, seed))
    open_ = [n for n, s in kitchen.things.items() if not s.blockers and not kitchen.shut_by(n)]
    pairs = [(a, b) for a, b in combinations(open_, 2) if _board(kitchen, a) == _board(kitchen, b)]
    for k in rng.permutation(len(pairs)):
        one, other = (kitchen.things[name].thing for name in pairs[k])
        if not all(place.taken_by_hand(t, place.standing(kitchen, t)) for t in (one, other)):
            continue
        still = place.standing(kitchen, one, other)
        for _ in range(_TRIES):
            first = place.free_place(kitchen, one, place.standing(kitchen, one), rng)
            if first is None:
                break
            about = Union([place.standing(kitchen, other), one.put(np.append(first, 0.0))])
            second = place.free_place(kitchen, other, about, rng)
            if second is not None and np.linalg.norm(first - second) < _NEAR:
                break
        else:
            continue
        if first is None or second is None:
            continue
        try:
            middle = np.array((one.pose[0], -1.3))
            start, heading = rollout.start_about(rng, middle, rollout.clear_of(still), 0.0, 1.5)
        except GoalError:
            continue
        return BothTrial(0, "both", seed, one.name, first, start, heading, other.name, second)
    return None


def _board(kitchen: Kitchen, name: str) -> tuple[str, float]:
    """What tells a board from others: its furniture and the height of what stands on it."""
    return kitchen.things[name].container, round(float(kitchen.things[name].thing.pose[2]), 2)


def request(trial: BothTrial, hold: float = 0.5, **more: Any) -> TakeRequest:
    """Set up one trial's take."""
    kitchen = make_kitchen(trial.seed)
    things = [kitchen.things[name].thing for name in (trial.thing, trial.also)]
    goals = [
        Goal("place", thing.name, where, 0.0, hold, prop=thing)
        for thing, where in zip(things, (trial.place, trial.there), strict=True)
    ]
    return TakeRequest(trial.start, trial.heading, goals, place.standing(kitchen, *things), **more)


def run_trial(model: Model, trial: BothTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out, as it is scheduled and strictly in order; the take and its figures."""
    asked = request(trial, **more)
    take = yield from rolled(model, asked)
    report = _figures(asked, take)
    asked = replace(request(trial, **more), in_order=True)
    one_by_one = _figures(asked, (yield from rolled(model, asked)))
    report["in_order_seconds"] = one_by_one["seconds"]
    report["in_order_success"] = float(one_by_one["placed"] > 0 and one_by_one["clean"] > 0)
    return take, report


def _figures(asked: TakeRequest, take: TakeResult) -> Report:
    report, _ = rollout.judge(asked, take, goal=len(asked.goals) - 1)
    things = [goal.moves(LightThing) for goal in asked.goals]
    off = [
        float(np.linalg.norm(take.props[thing.name][-1, :3] - goal.position))
        for thing, goal in zip(things, asked.goals, strict=True)
    ]
    report["hand_pe_cm"] = max(goal.hand_error_cm for goal in take.goals)
    report["seconds"] = max(goal.end_frame for goal in take.goals) / FPS
    report["thing_in_solids_cm"] = 100 * max(
        thing_in_solids(thing, take.props[thing.name], asked.environment) for thing in things
    )
    report["placed"] = float(all(goal.reached for goal in take.goals) and max(off) <= place.PLACED)
    clean = report["penetration_cm"] <= place.DEEP and report["thing_in_solids_cm"] <= place.SUNK
    report["clean"] = float(clean)
    report["at_once"] = float(any("carried at once" in line for g in take.goals for line in g.remarks))
    return report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return place.summarise(reports) | {
        "at_once": rollout.share(reports, lambda r: r["at_once"] > 0),
        "in_order_success": rollout.share(reports, lambda r: r["in_order_success"] > 0),
    }


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [
        ("carried at once", f"{s['at_once']:.0%}", "", ""),
        *place.rows(s),
        ("one after the other: seconds (median)", f"{s['in_order_seconds_median']:.1f}", "", ""),
        ("one after the other: placed and clean", f"{s['in_order_success']:.0%}", "", ""),
    ]


PART = TrialPart(
    "pick and place of two things", lambda starts, pool: trials(starts), run_trial, summarise, rows, request,
    ("place",), beside="place", done="success",
)  # fmt: skip
