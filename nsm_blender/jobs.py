"""Job files: which takes a batch makes, and sentences about what is wrong in them."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nsm_core.errors import JobError, NsmError

from .actions import require_action

OUTPUTS = ("out", "sheet", "video", "bvh", "report")
_JOB_KEYS = ("scene", "take")
_TAKE_KEYS = ("name", "character", "seed", "start_frame", "contact_ik", "goals", *OUTPUTS)
_GOAL_KEYS = ("object", "action", "to", "hold", "location")


@dataclass(frozen=True)
class JobGoal:
    """A goal of a job file: an object's name or a place (3,), world; ``to`` names the destination of what is carried."""

    action: str
    object: str | None = None
    hold: float = 2.0
    location: tuple[float, float, float] | None = None
    to: str | None = None


@dataclass
class JobTake:
    """A take of a job file; ``error`` is the sentence about what is wrong with its entry, if anything."""

    name: str
    character: str = "Character"
    seed: int = 0
    start_frame: int = 1
    contact_ik: bool = True
    goals: list[JobGoal] = field(default_factory=list)
    outputs: dict[str, Path] = field(default_factory=dict)
    error: str | None = None


@dataclass
class Job:
    """A job file that has been read: a scene and its takes."""

    path: Path
    scene: Path
    takes: list[JobTake]


def read_job(path: str | Path) -> Job:
    """Read a job file; paths in it are relative to it.

    Raises JobError when the file as a whole is of no use.  What is wrong with one take is kept in that
    take's ``error``, so that the others go on.
    """
    path = Path(path).resolve()
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise JobError(f"The job file {path} cannot be read ({error.strerror}); check its path.") from error
    except UnicodeDecodeError as error:
        raise JobError(f"The job file {path.name} is not UTF-8 text; save it as UTF-8.") from error
    except tomllib.TOMLDecodeError as error:
        raise JobError(f"The job file {path.name} is not valid TOML: {error}; correct that line.") from error
    _known(data, _JOB_KEYS, "the job file")
    scene = _value(data, "scene", str, "the job file", required=True)
    entries = data.get("take")
    if not isinstance(entries, list) or not entries or not all(isinstance(e, dict) for e in entries):
        raise JobError("The job file has no takes; add at least one [[take]].")
    takes = [_take(entry, number, path.parent) for number, entry in enumerate(entries, 1)]
    _refuse_clashes(takes)
    return Job(path, path.parent / scene, takes)


def _take(entry: dict[str, Any], number: int, folder: Path) -> JobTake:
    name = entry.get("name")
    take = JobTake(name if isinstance(name, str) and name else f"take {number}")
    where = f"take '{take.name}'"
    if isinstance(entry.get("report"), str):
        take.outputs["report"] = folder / entry["report"]  # first, so that an error below can be reported there
    try:
        _known(entry, _TAKE_KEYS, where)
        _value(entry, "name", str, where, required=True)
        take.character = _value(entry, "character", str, where, default=take.character)
        take.seed = _value(entry, "seed", int, where, default=take.seed)
        take.start_frame = _value(entry, "start_frame", int, where, default=take.start_frame)
        take.contact_ik = _value(entry, "contact_ik", bool, where, default=take.contact_ik)
        if take.seed < 0:
            raise JobError(f"In {where}, 'seed' is {take.seed}; give a whole number of 0 or more.")
        for key in OUTPUTS:
            if key in entry:
                take.outputs[key] = folder / _value(entry, key, str, where)
        goals = _value(entry, "goals", list, where, required=True)
        if not goals:
            raise JobError(f"In {where}, 'goals' is empty; give at least one goal.")
        take.goals = [_goal(goal, f"goal {i} of {where}") for i, goal in enumerate(goals, 1)]
    except NsmError as error:
        take.error = str(error)
    return take


def _goal(entry: Any, where: str) -> JobGoal:
    if not isinstance(entry, dict):
        raise JobError(f'In {where}, a table is needed, such as {{ object = "Chair", action = "sit" }}.')
    _known(entry, _GOAL_KEYS, where)
    action = require_action(_value(entry, "action", str, where, required=True))
    target = _value(entry, "object", str, where, required=action.needs_object)
    to = _value(entry, "to", str, where, required=action.needs_destination)
    if to is not None and not action.needs_destination:
        raise JobError(f"In {where}, 'to' says where a box is carried; remove it, or take the action 'carry'.")
    hold = float(_value(entry, "hold", (int, float), where, default=2.0))
    if not 0 <= hold <= 600:
        raise JobError(f"In {where}, 'hold' is {hold:g}; give seconds from 0 to 600.")
    location = _value(entry, "location", list, where)
    if location is not None and (len(location) != 3 or not all(_is(v, (int, float)) for v in location)):
        raise JobError(f"In {where}, 'location' needs three numbers, such as [1.0, 2.0, 0.0].")
    if location is not None and action.needs_object:
        raise JobError(f"In {where}, '{action.key}' needs its 'object' alone; remove 'location', or place the object there.")
    if action.key in ("walk", "run") and target is None and location is None:
        raise JobError(f"In {where}, '{action.key}' needs an 'object' or a 'location'; add one.")
    if action.key == "idle" and (target or location):
        raise JobError(f"In {where}, 'idle' stands where the character is; take 'walk' with a 'hold' to stand at an object or a place.")
    return JobGoal(action.key, target, hold, tuple(map(float, location)) if location else None, to)


def _refuse_clashes(takes: list[JobTake]) -> None:
    """Mark takes that would write over a file of an earlier take, or over their own."""
    seen: dict[Path, str] = {}
    for take in takes:
        for key, path in list(take.outputs.items()):
            if path in seen:
                take.error = take.error or f"In take '{take.name}', '{key}' is the same file as {seen[path]}; give each output its own."
                del take.outputs[key]
            else:
                seen[path] = f"'{key}' of take '{take.name}'"


def _known(entry: dict[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in entry:
        if key not in keys:
            raise JobError(f"The key '{key}' in {where} is unknown; the keys are {', '.join(keys)}.")


def _value(entry: dict[str, Any], key: str, kind: Any, where: str, *, required: bool = False, default: Any = None) -> Any:
    if key not in entry:
        if required:
            raise JobError(f"The key '{key}' is missing in {where}; add it.")
        return default
    value = entry[key]
    if not _is(value, kind) or value == "":
        raise JobError(f"The key '{key}' in {where} is {value!r}; {_WORDS[kind]} is needed.")
    return value


def _is(value: Any, kind: Any) -> bool:
    return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))


_WORDS = {str: "a text in quotes", int: "a whole number", bool: "true or false", list: "a list", (int, float): "a number"}
