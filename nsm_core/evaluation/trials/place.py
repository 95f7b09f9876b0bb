"""Pick and place trials: in kitchens by seed, one light thing that stands open, to a free place elsewhere.

Things that the add-on refuses by a rule that it tells beforehand are not drawn: those that stand lower or
higher than one hand takes things, and those at which no hand has room.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import thing_in_solids
from nsm_core.evaluation.measures.touches import told, touches
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array
from nsm_core.world.affordances.picking import LOWEST, grasps_with_room
from nsm_core.world.affordances.reach import REACHED
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.furniture import cuboids
from nsm_core.world.scene.props import LightThing, Prop

from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

PLACED, DEEP = (
    0.02,
    2.0,
)  # metres off its place at which a thing counts as put; cm that a body may be in things
SUNK = 1.0  # cm that the thing itself may be in what stands there
_EDGE = (0.1, 0.2)  # metres from the front edge of a board to the middle of a thing that is put on it
_FREE = 0.06  # metres about a thing where it is put that are free
_GRID, _GAP = 0.04, 0.01  # metres between points there that are looked at, and from them to what stands
_HIGHEST = 1.6  # metres over the floor of a board that a thing is put on
_TRIES = 60
FIRST = 300  # seed of the first kitchen of all conditions: rules were mended on some of those before


@dataclass(frozen=True)
class PlaceTrial:
    """The ``thing`` of the kitchen of a ``seed``, by its name, and where (3,) its foot is put; one start."""

    setting: int
    name: str
    seed: int
    thing: str
    place: Array
    start: Array
    heading: float


def trials(kitchens: int = 10) -> list[PlaceTrial]:
    """The same trials at every call: one in each of so many kitchens."""
    made = (_trial(seed) for seed in range(FIRST, FIRST + kitchens))
    return [one for one in made if one is not None]


def _trial(seed: int) -> PlaceTrial | None:
    kitchen = make_kitchen(seed)
    names = [n for n, s in kitchen.things.items() if not s.blockers and not kitchen.shut_by(n)]
    return drawn(
        PlaceTrial, "open", kitchen, 14, names, lambda name, thing, still: taken_by_hand(thing, still)
    )


_Trial = TypeVar("_Trial", bound=PlaceTrial)


def drawn(
    kind: type[_Trial],
    title: str,
    kitchen: Kitchen,
    stream: int,
    names: Sequence[str],
    fits: Callable[[str, LightThing, DistanceQuery], bool],
    apt: Callable[[_Trial], bool] = lambda trial: True,
) -> _Trial | None:
    """Draw a trial of a ``kind`` about one of the things ``names`` of a kitchen that ``fits`` among what
    stands there: where it is put, and a start; None where none has both and is ``apt`` then.  ``stream``
    tells draws apart.
    """
    rng = np.random.default_rng((SEED, stream, kitchen.seed))
    for k in rng.permutation(len(names)):
        thing = kitchen.things[names[k]].thing
        still = standing(kitchen, thing)
        if not fits(names[k], thing, still):
            continue
        place = free_place(kitchen, thing, still, rng)
        if place is None:
            continue
        try:
            middle = np.array((thing.pose[0], -1.3))
            start, heading = rollout.start_about(rng, middle, rollout.clear_of(still), 0.0, 1.5)
        except GoalError:
            continue
        trial = kind(0, title, kitchen.seed, thing.name, place, start, heading)
        if apt(trial):
            return trial
    return None


def taken_by_hand(thing: LightThing, around: DistanceQuery) -> bool:
    """Whether a hand has room at a thing where it is, among what is ``around`` it, at a height at which one
    takes things.
    """
    heights = (grasp.at(thing.pose).held[2] for grasp in grasps_with_room(thing, around))
    return any(LOWEST <= height <= REACHED[1] for height in heights)


def standing(kitchen: Kitchen, *but: Prop) -> Cuboids:
    """What stands of a kitchen ``but`` some things and parts, no floor; furniture shut, other things as
    boxes.
    """
    whole = Cuboids()
    whole.groups = [g for one in named(kitchen, *but).values() for g in one.groups]
    return whole


def named(kitchen: Kitchen, *but: Prop) -> dict[str, Cuboids]:
    """The same by the names of walls, furniture and things."""
    found = {"walls": cuboids([(kitchen.walls, np.zeros(3), 0.0)])}
    for name, container in kitchen.containers.items():
        found[name] = Cuboids()
        found[name].groups = [*container.standing().groups]
        for part in [p for p in container.parts if all(p is not b for b in but)]:
            shut = part.query.groups if isinstance(part.query, Cuboids) else []
            boxes = [(part.pose[:3], part.pose[3], g.centres - g.halves, g.centres + g.halves) for g in shut]
            found[name].groups += Cuboids(boxes).groups
    for name, standing_ in kitchen.things.items():
        thing = standing_.thing
        if all(thing is not b for b in but):
            found[name] = Cuboids([(thing.pose[:3], thing.pose[3], thing.low[None], thing.high[None])])
    return found


def free_place(
    kitchen: Kitchen, thing: LightThing, still: DistanceQuery, rng: np.random.Generator
) -> Array | None:
    """Draw where (3,) a thing is put: near the front edge of an open board other than its own."""
    own = kitchen.things[thing.name].container
    boards = [
        (c, b)
        for name, c in kitchen.containers.items()
        for b in c.boards
        if name != own
        and not c.parts
        and b.room > thing.size[2] + 0.1
        and LOWEST < b.height + c.pose[2] < _HIGHEST
    ]
    half = float(np.linalg.norm(np.maximum(-thing.low, thing.high)[:2]))  # of a thing turned about its foot
    lines = np.arange(-half - _FREE, half + _FREE + _GRID, _GRID)
    disc = np.stack(np.meshgrid(lines, lines, [0.0], indexing="ij"), -1).reshape(-1, 3)
    disc = disc[np.linalg.norm(disc, axis=1) <= half + _FREE]
    for _ in range(_TRIES):
        container, board = boards[int(rng.integers(len(boards)))]
        y = board.low[1] + max(float(rng.uniform(*_EDGE)), half + 0.02)
        x = (
            float(rng.uniform(board.low[0] + half, board.high[0] - half))
            if board.size[0] > 2 * half
            else np.nan
        )
        if not np.isfinite(x) or y + half > board.high[1]:
            continue
        if container.kind == "table" and rng.random() < 0.5:  # from behind it
            y = board.low[1] + board.high[1] - y
        place = container.to_world((x, y, board.height))
        up = np.arange(0.02, float(thing.size[2]) + 0.03, 0.03)
        column = np.repeat(disc + place, len(up), 0) + np.tile(up, len(disc))[:, None] * (0, 0, 1)
        if (still.signed_distance(column.astype(np.float32), 0.1) > _GAP).all():
            return np.asarray(place, dtype=np.float64)
    return None


def request(trial: PlaceTrial, hold: float = 0.5, **more: Any) -> TakeRequest:
    """Set up one trial's take."""
    kitchen = make_kitchen(trial.seed)
    thing = kitchen.things[trial.thing].thing
    goal = Goal("place", trial.thing, trial.place, 0.0, hold, prop=thing)
    return TakeRequest(trial.start, trial.heading, [goal], standing(kitchen, thing), **more)


def run_trial(model: Model, trial: PlaceTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    return (yield from figures(model, request(trial, **more), trial.place, make_kitchen(trial.seed)))


def figures(
    model: Model, asked: TakeRequest, place: Array, kitchen: Kitchen
) -> Trying[tuple[TakeResult, Report]]:
    """Roll out what is asked for in a ``kitchen``, whose last goal brings a thing to a ``place`` (3,): the
    take and its figures.
    """
    take = yield from rolled(model, asked)
    report, _ = rollout.judge(asked, take, goal=len(asked.goals) - 1)
    thing = asked.goals[-1].prop
    assert isinstance(thing, LightThing)
    poses = take.props[thing.name]
    off = float(np.linalg.norm(poses[-1, :3] - place))
    report["thing_off_cm"] = 100 * off
    report["thing_in_solids_cm"] = 100 * thing_in_solids(thing, poses, asked.environment)
    report["placed"] = float(bool(report["reached"]) and off <= PLACED)
    report["clean"] = float(report["penetration_cm"] <= DEEP and report["thing_in_solids_cm"] <= SUNK)
    if not report["clean"]:
        moved = rollout.props_of(asked)
        still = named(kitchen, *_moved(kitchen, moved))
        found = told(touches(take, still, moved, DEEP / 100, SUNK / 100))
        report["touched"] = f"kitchen {kitchen.seed}, {thing.name}: {found}"  # type: ignore[assignment]
    return take, report


def _moved(kitchen: Kitchen, moved: Mapping[str, Prop]) -> list[Prop]:
    """What of a kitchen is ``moved``, with what stands in drawers that are."""
    fronts = [prop for prop in moved.values() if isinstance(prop, Front)]
    parts: list[Prop] = [
        p for c in kitchen.containers.values() for p in c.parts if f"{c.name} {p.name}" in moved
    ]
    things = [
        s.thing
        for name, s in kitchen.things.items()
        if name in moved or any(front.carries(s.thing.pose) for front in fronts)
    ]
    return [*parts, *things]


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return rollout.summarise(reports) | {
        "placed": rollout.share(reports, lambda r: r["placed"] > 0),
        "success": rollout.share(reports, lambda r: r["placed"] > 0 and r["clean"] > 0),
    }


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    hand = f"{s['hand_pe_cm_mean']:.2f} / {s['hand_pe_cm_worst']:.2f}"
    sunk = f"{s['thing_in_solids_cm_median']:.1f} / {s['thing_in_solids_cm_worst']:.1f}"
    return [
        ("placed within 2 cm, upright", f"{s['placed']:.0%}", "", ""),
        ("placed, body no deeper than 2 cm and thing than 1 cm", f"{s['success']:.0%}", "", "95 %"),
        ("wrist off its grasp cm, with the solver (mean / worst)", hand, "", "1"),
        ("thing inside what stands there cm (median / worst)", sunk, "", "0"),
        ("seconds (median)", f"{s['seconds_median']:.1f}", "", ""),
    ]


PART = TrialPart(
    "pick and place", lambda starts, pool: trials(starts), run_trial, summarise, rows, request, ("place",),
    done="success",
)  # fmt: skip
