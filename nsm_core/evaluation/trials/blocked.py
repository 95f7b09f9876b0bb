"""Pick and place trials of what is blocked: in kitchens by seed, one light thing with another one before it,
which is put aside first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count, islice
from typing import Any

import numpy as np

from nsm_core.control.actions.place import planned
from nsm_core.control.aside import with_aside
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import thing_in_solids
from nsm_core.model.inference.model import Model
from nsm_core.world.affordances.clearing import NEIGHBOUR
from nsm_core.world.affordances.picking import LOWEST
from nsm_core.world.affordances.reach import REACHED
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import LightThing

from . import place, rollout
from .part import TrialPart
from .rollout import Report
from .together import Trying

_BLOCKED = 1.0  # share of filled boards on which something is put before a thing at the back
_TRIED = 5  # things of a kitchen that are tried
_FLOOR = 3.0  # metres of floor planned on around the thing and its place


@dataclass(frozen=True)
class BlockedTrial(place.PlaceTrial):
    """A trial of ``place`` whose thing another one stands before."""


def trials(kitchens: int = 10) -> list[BlockedTrial]:
    """The same trials at every call: one in each of the first so many kitchens that have such a thing in the
    open.
    """
    made = (one for seed in count(place.FIRST) if (one := _trial(seed)) is not None)
    return list(islice(made, kitchens))


def kitchen_of(seed: int) -> Kitchen:
    """The kitchen of a seed with more on its boards that stands behind something else than usual."""
    return make_kitchen(seed, blocked=_BLOCKED)


def _trial(seed: int) -> BlockedTrial | None:
    """The trial of a seed: of a thing in the open that nobody gets at as it stands, but would without its
    neighbours; None where none of the first ones is like that.
    """
    kitchen = kitchen_of(seed)
    names = [n for n, s in kitchen.things.items() if s.blockers and not kitchen.shut_by(n)][:_TRIED]
    return place.drawn(BlockedTrial, "blocked", kitchen, 16, names, _within, partial(_hemmed_in, kitchen))


def _hemmed_in(kitchen: Kitchen, trial: BlockedTrial) -> bool:
    """Whether a hand cannot take a thing past what stands there, and can where its neighbours are gone."""
    thing = kitchen.things[trial.thing].thing
    off = {n: s.thing.middle - thing.middle for n, s in kitchen.things.items() if s.thing is not thing}
    near = [kitchen.things[n].thing for n, o in off.items() if np.hypot(*o[:2]) < NEIGHBOUR]
    return not _taken(kitchen, trial, []) and _taken(kitchen, trial, near)


def _taken(kitchen: Kitchen, trial: BlockedTrial, gone: Sequence[LightThing]) -> bool:
    thing = kitchen.things[trial.thing].thing
    solids = place.standing(kitchen, thing, *gone)
    goal = Goal("place", trial.thing, trial.place, 0.0, prop=thing)
    try:
        planned(goal, solids, _floor(solids, goal, trial), trial.start[:2].astype(np.float64))
    except GoalError:
        return False
    return True


def _floor(solids: Cuboids, goal: Goal, trial: place.PlaceTrial) -> FloorPlan:
    ends = np.stack((goal.moves(LightThing).pose[:2], trial.place[:2], trial.start[:2]))
    return FloorPlan(solids, (ends.min(0) - _FLOOR, ends.max(0) + _FLOOR))


def _within(name: str, thing: LightThing, still: DistanceQuery) -> bool:
    """Whether a thing stands at a height at which hands take things."""
    return bool(LOWEST < thing.middle[2] < REACHED[1] - 0.1)


def request(trial: place.PlaceTrial, hold: float = 0.5, **more: Any) -> TakeRequest:
    """Set up one trial's take: with what is put aside first where the thing cannot be taken as it stands.
    Raises GoalError where nothing helps.
    """
    kitchen = kitchen_of(trial.seed)
    thing = kitchen.things[trial.thing].thing
    goal = Goal("place", trial.thing, trial.place, 0.0, hold, prop=thing)
    goal = asked_for(kitchen, goal, trial)
    moved = [one.prop for one in goal.parts if one.prop is not None]
    return TakeRequest(trial.start, trial.heading, [goal], place.standing(kitchen, *moved), **more)


def asked_for(kitchen: Kitchen, goal: Goal, trial: place.PlaceTrial) -> Goal:
    """The goal as planned, with what is put aside first."""
    thing = goal.moves(LightThing)
    others = [s.thing for s in kitchen.things.values() if s.thing is not thing]
    solids = place.standing(kitchen, thing)
    plan = _floor(solids, goal, trial)
    try:
        planned(goal, solids, plan, trial.start[:2].astype(np.float64))
    except GoalError as error:
        return with_aside(
            goal, thing, others, partial(_without, kitchen), plan, trial.start[:2].astype(np.float64), error
        )
    return goal


def _without(kitchen: Kitchen, gone: Sequence[LightThing]) -> Cuboids:
    names = {one.name for one in gone}
    return place.standing(kitchen, *(s.thing for n, s in kitchen.things.items() if n in names))


def run_trial(model: Model, trial: BlockedTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)
    take, report = yield from place.figures(model, asked, trial.place, kitchen_of(trial.seed))
    aside = asked.goals[0].first
    report["aside"] = float(len(aside))
    off = [np.linalg.norm(take.props[g.name][-1, :3] - g.position) for g in aside]
    report["aside_off_cm"] = 100 * float(max(off, default=0.0))
    sunk = [thing_in_solids(g.moves(LightThing), take.props[g.name], asked.environment) for g in aside]
    report["aside_in_solids_cm"] = 100 * float(max(sunk, default=0.0))
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return place.summarise(reports) | {"cleared": rollout.share(reports, lambda r: r["aside"] > 0)}


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [
        ("with something put aside first", f"{s['cleared']:.0%}", "", ""),
        ("what was put aside, off its place cm (worst)", f"{s['aside_off_cm_worst']:.1f}", "", ""),
        *place.rows(s)[:1],
        (*place.rows(s)[1][:3], "75 %"),
        *place.rows(s)[2:],
    ]


PART = TrialPart(
    "pick and place of what is blocked", lambda starts, pool: trials(starts), run_trial, summarise, rows,
    request, ("place",), beside="place", done="success",
)  # fmt: skip
