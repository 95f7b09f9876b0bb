"""Pick and place trials of what is shut away: in kitchens by seed, one light thing behind doors or in a
drawer, which are opened before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.picking import LOWEST
from nsm_core.world.affordances.pulling import HIGHEST
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing

from . import place, rollout
from .part import TrialPart
from .rollout import Report
from .together import Trying


@dataclass(frozen=True)
class ShutTrial(place.PlaceTrial):
    """A trial of ``place`` whose thing is shut away."""


def trials(kitchens: int = 10) -> list[ShutTrial]:
    """The same trials at every call: one in each of so many kitchens."""
    made = (_trial(seed) for seed in range(place.FIRST, place.FIRST + kitchens))
    return [one for one in made if one is not None]


def _trial(seed: int) -> ShutTrial | None:
    kitchen = make_kitchen(seed)
    names = [n for n, s in kitchen.things.items() if not s.blockers and _opens(kitchen, n)]

    def fits(name: str, thing: LightThing, still: DistanceQuery) -> bool:
        container = kitchen.board_of(name)[0]
        opened = [container.part(part) for part in kitchen.shut_by(name)]
        return place.taken_by_hand(thing, place.standing(kitchen, thing, *opened))

    return place.drawn(ShutTrial, "shut", kitchen, 15, names, fits)


def _opens(kitchen: Kitchen, name: str) -> bool:
    """Whether a thing is shut away by what hands open, at a height at which they work."""
    container, _ = kitchen.board_of(name)
    parts = [container.part(p) for p in kitchen.shut_by(name)]
    heights = [float(p.to_world(p.handle)[2]) for p in parts]
    heights.append(float(kitchen.things[name].thing.middle[2]))
    within = LOWEST < min(heights) < max(heights) < HIGHEST
    return within and bool(parts) and all(p.kind != "lid" for p in parts)


def fronts(kitchen: Kitchen, name: str) -> tuple[list[Front], list[LightThing]]:
    """The fronts that shut a thing away, and the other things that go along with them."""
    container, _ = kitchen.board_of(name)
    found, along = list[Front](), list[LightThing]()
    for part in (container.part(p) for p in kitchen.shut_by(name)):
        title = f"{container.name} {part.name}"
        bare = Front.of(part, title)
        inside = [s.thing for n, s in kitchen.things.items() if n != name and bare.carries(s.thing.pose)]
        boxes = [(*_own(bare, thing), thing.low[None], thing.high[None]) for thing in inside]
        found.append(Front.of(part, title, Cuboids(boxes)) if boxes else bare)
        along += [*inside]
    return found, along


def _own(front: Front, thing: LightThing) -> tuple[Array, float]:
    """Place (3,) and heading of a thing in a front's frame."""
    off = rotate_planar(thing.pose[:3] - front.pose[:3], np.float64(-front.pose[3]))
    return off, float(thing.pose[3] - front.pose[3])


def request(trial: place.PlaceTrial, hold: float = 0.5, **more: Any) -> TakeRequest:
    """Set up one trial's take."""
    kitchen = make_kitchen(trial.seed)
    thing = kitchen.things[trial.thing].thing
    opened, along = fronts(kitchen, trial.thing)
    goals = []
    for front in opened:
        middle = front.to_world(front.volume.centre)
        goals.append(Goal("open", front.name, np.append(middle[:2], 0.0), 0.0, 0.0, prop=front))
    goals.append(Goal("place", trial.thing, trial.place, 0.0, hold, prop=thing))
    still = place.standing(kitchen, thing, *along, *(front.part for front in opened))
    return TakeRequest(trial.start, trial.heading, goals, still, **more)


def run_trial(model: Model, trial: ShutTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    take, report = yield from place.figures(
        model, request(trial, **more), trial.place, make_kitchen(trial.seed)
    )
    opened = take.goals[:-1]
    report["opened"] = float(all(goal.reached for goal in opened))
    report["handle_cm"] = max(goal.hand_error_cm for goal in opened)
    report["seconds"] = sum(goal.seconds for goal in take.goals)
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return place.summarise(reports) | {"opened": rollout.share(reports, lambda r: r["opened"] > 0)}


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    handle = f"{s['handle_cm_mean']:.2f} / {s['handle_cm_worst']:.2f}"
    return [
        ("all that shuts it away opened", f"{s['opened']:.0%}", "", ""),
        ("wrist off the handle as it is taken cm, with the solver (mean / worst)", handle, "", "1"),
        *place.rows(s),
    ]


PART = TrialPart(
    "pick and place of what is shut away", lambda starts, pool: trials(starts), run_trial, summarise, rows,
    request, ("place",), beside="place", done="success",
)  # fmt: skip
