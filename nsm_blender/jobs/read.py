"""Job files: which takes a batch makes, and sentences about what is wrong in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from nsm_core import validate
from nsm_core.body.key_reduction import Bound
from nsm_core.errors import JobError, NsmError
from nsm_core.world.actions import Aim, require_action

from ..begin import BEGINNINGS
from ..keys.style import KINDS
from .entries import (
    FIRST_FRAME,
    LARGEST_SEED,
    LAST_START,
    begun,
    flag,
    frame,
    known,
    needed,
    one_of,
    read_actor,
)
from .fills import read_fill
from .job import Job, JobGoal, JobTake
from .paths import refuse_clashes, require_path, require_words
from .ways import WAY_KEYS, read_way

OUTPUTS = ("report", "out", "sheet", "video", "bvh", "glb")
_JOB_KEYS = ("scene", "scripts", "take", "fill")
_TAKE_KEYS = (
    "name", "character", "characters", "rig", "seed", "variations", "start", "start_frame", "contact_ik",
    "in_order", "root_motion", "reduce", "goals", "overwrite", *OUTPUTS,
)  # fmt: skip
_CAST_KEYS = ("character", "goals")
_HEAVIEST = 60.0  # kilograms that a goal may give what is carried
_GOAL_KEYS = ("object", "action", "to", "hold", "location", "by", "mass", "close_after", *WAY_KEYS)
_MOST_VARIATIONS = 1000
_LONGEST_HOLD = 600.0  # seconds
_FARTHEST = 1e6  # of a coordinate
_MILLIMETRES, _DEGREES = (0.1, 100.0), (0.05, 20.0)  # as in the sidebar


def read_job(path: str | Path) -> Job:
    """Read a job file; paths in it are relative to it.

    Raises JobError when the file as a whole is of no use.  What is wrong with one take is kept in that
    take's ``error``, so that the others go on.
    """
    try:
        path = Path(path).resolve()
    except (OSError, ValueError, RuntimeError) as error:  # a null byte, links in a ring
        raise JobError(
            f"The job file {validate.shown(str(path))} cannot be read ({error}); check its path."
        ) from error
    data = validate.read_toml(path, JobError)
    known(data, _JOB_KEYS, "the job file")
    scene = require_path(needed(data, "scene", "the job file"), "'scene' in the job file", path.parent)
    scripts = flag(data, "scripts", "the job file", False)
    entries, gaps = data.get("take", []), data.get("fill", [])
    if not isinstance(entries, list) or not isinstance(gaps, list) or not [*entries, *gaps]:
        raise JobError("The job file has no takes; add at least one [[take]] or [[fill]].")
    takes = [
        take
        for number, entry in enumerate(entries, 1)
        for take in _variations(_take(entry, number, path.parent), entry)
    ]
    takes += [read_fill(entry, number, path.parent) for number, entry in enumerate(gaps, 1)]
    refuse_clashes(path, scene, takes)
    return Job(path, scene, takes, scripts)


def _take(entry: Any, number: int, folder: Path) -> JobTake:
    take = JobTake(f"take {number}")
    try:
        where, wrong = begun(take, entry, "take", OUTPUTS, folder)
        known(entry, _TAKE_KEYS, where)
        take.name = require_words(needed(entry, "name", where), f"'name' in {where}")
        if wrong:
            raise wrong
        read_actor(take, entry, where, folder)
        validate.whole(entry.get("variations", 1), f"'variations' in {where}", JobError, 1, _MOST_VARIATIONS)
        take.start = one_of(entry, "start", where, BEGINNINGS)
        take.root_motion = one_of(entry, "root_motion", where, KINDS)
        take.reduce = _bound(entry, where)
        take.start_frame = frame(entry.get("start_frame", take.start_frame), f"'start_frame' in {where}")
        take.contact_ik = flag(entry, "contact_ik", where, take.contact_ik)
        take.in_order = flag(entry, "in_order", where, take.in_order)
        take.overwrite = flag(entry, "overwrite", where, take.overwrite)
        if "characters" in entry:
            take.characters = _characters(entry, where)
        else:
            take.goals = _goals(entry, where)
    except NsmError as error:
        take.error = str(error)
    return take


def _goals(entry: dict[str, Any], where: str) -> list[JobGoal]:
    goals = validate.listed(needed(entry, "goals", where), f"'goals' in {where}", JobError, 1000)
    if not goals:
        raise JobError(f"In {where}, 'goals' is empty; give at least one goal.")
    return [_goal(goal, f"goal {i} of {where}") for i, goal in enumerate(goals, 1)]


def _characters(entry: dict[str, Any], where: str) -> list[tuple[str, list[JobGoal]]]:
    """Those who act together, each with its goals."""
    for key in ("character", "goals"):
        if key in entry:
            raise JobError(f"In {where}, 'characters' holds the goals of each; remove '{key}'.")
    for key in ("bvh", "glb"):
        if key in entry:
            raise JobError(f"In {where}, '{key}' is of one character; remove it from a take of several.")
    rows = validate.listed(entry["characters"], f"'characters' in {where}", JobError, 100)
    cast: dict[str, list[JobGoal]] = {}
    for number, row in enumerate(rows, 1):
        here = f"character {number} of {where}"
        validate.table(row, here, JobError)
        known(row, _CAST_KEYS, here)
        name = require_words(needed(row, "character", here), f"'character' in {here}")
        if name in cast:
            raise JobError(f"In {where}, '{name}' is among the characters twice; put its goals together.")
        cast[name] = _goals(row, here)
    if len(cast) < 2:
        raise JobError(f"In {where}, 'characters' needs two at least; give one its 'character' and 'goals'.")
    return list(cast.items())


def _variations(take: JobTake, entry: Any) -> list[JobTake]:
    """A take as often as its entry asks for: each by another seed, its number in its name and its files."""
    count = 1 if take.error else entry.get("variations", 1)
    if count == 1:
        return [take]
    return [
        replace(
            take,
            name=f"{take.name} {number}",
            seed=(take.seed + number - 1) % (LARGEST_SEED + 1),
            outputs={k: path.with_stem(f"{path.stem}-{number}") for k, path in take.outputs.items()},
        )
        for number in range(1, count + 1)
    ]


def _bound(entry: dict[str, Any], where: str) -> Bound | None:
    """How far the motion may be off for fewer keys: a number of millimetres, or a table with degrees, too."""
    found = entry.get("reduce")
    if found is None:
        return None
    what = f"'reduce' in {where}"
    if not isinstance(found, dict):
        found = {"mm": validate.number(found, what, JobError, *_MILLIMETRES)}
    known(found, ("mm", "degrees"), what)
    return Bound(
        validate.number(found.get("mm", Bound.mm), f"'mm' of {what}", JobError, *_MILLIMETRES),
        validate.number(found.get("degrees", Bound.degrees), f"'degrees' of {what}", JobError, *_DEGREES),
    )


def _goal(entry: Any, where: str) -> JobGoal:
    if not isinstance(entry, dict):
        raise JobError(f'In {where}, a table is needed, such as {{ object = "Chair", action = "sit" }}.')
    known(entry, _GOAL_KEYS, where)
    action = require_action(require_words(needed(entry, "action", where), f"'action' in {where}"))
    target = _object(entry, "object", where, action.needs_object)
    to = _object(entry, "to", where, action.needs_destination)
    if to is not None and not action.needs_destination:
        raise JobError(
            f"In {where}, 'to' says where a thing is brought; remove it, or take the action 'carry' or "
            "'place'."
        )
    hold = validate.number(entry.get("hold", 2.0), f"'hold' in {where}", JobError, 0, _LONGEST_HOLD)
    location = entry.get("location")
    if location is not None and (not isinstance(location, list) or len(location) != 3):
        raise JobError(f"In {where}, 'location' needs three numbers, such as [1.0, 2.0, 0.0].")
    if location is not None:
        location = tuple(
            validate.number(v, f"'location' in {where}", JobError, -_FARTHEST, _FARTHEST) for v in location
        )
    if location is not None and action.needs_object:
        raise JobError(
            f"In {where}, '{action.key}' needs its 'object' alone; remove 'location', or place the object "
            "there."
        )
    curve, rounds, speed = read_way(entry, action.key, where)
    if action.aim is Aim.PLACE and target is None and location is None and curve is None:
        raise JobError(f"In {where}, '{action.key}' needs an 'object' or a 'location'; add one.")
    if action.aim is Aim.HERE and (target or location is not None):
        raise JobError(
            f"In {where}, '{action.key}' stands where the character is; take 'walk' with a 'hold' to stand "
            "at an object or a place."
        )
    by = entry.get("by")
    if by is not None:
        by = validate.whole(by, f"'by' in {where}", JobError, FIRST_FRAME, LAST_START)
    mass = entry.get("mass")
    if mass is not None and not action.needs_destination:
        raise JobError(
            f"In {where}, 'mass' is that of what is brought somewhere; remove it, or take the action 'carry' "
            "or 'place'."
        )
    if mass is not None:
        mass = validate.number(mass, f"'mass' in {where}", JobError, 0, _HEAVIEST)
    if "close_after" in entry and not action.pairs:
        raise JobError(
            f"In {where}, 'close_after' is of what is opened to take a thing out; remove it, or take the "
            "action 'place'."
        )
    close = flag(entry, "close_after", where, True)
    return JobGoal(action.key, target, hold, location, to, curve, rounds, speed, by, mass, close)


def _object(entry: dict[str, Any], key: str, where: str, must: bool) -> str | None:
    if key not in entry and not must:
        return None
    return require_words(needed(entry, key, where), f"'{key}' in {where}")
