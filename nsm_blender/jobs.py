"""Job files: which takes a batch makes, and sentences about what is wrong in them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nsm_core.errors import JobError, NsmError
from nsm_core.validate import is_number, read_toml, shown

from .actions import require_action
from .outputs import identities, require_name

OUTPUTS = ("out", "sheet", "video", "bvh", "report")
MOST_FRAME = 1_048_574  # what Blender's frame numbers hold
MOST_SEED = 2**31 - 1
FAR = 1e5  # a place's coordinates: farther off, single precision no longer tells centimetres apart
_ENDINGS = {"sheet": ".png", "video": ".mp4"}  # added by what writes them; known here, so that two of one name are seen
_JOB_KEYS = ("scene", "scripts", "take")
_TAKE_KEYS = ("name", "character", "seed", "start_frame", "contact_ik", "goals", "overwrite", *OUTPUTS)
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
    overwrite: bool = False  # whether ``out`` may be the scene itself
    error: str | None = None


@dataclass
class Job:
    """A job file that has been read: a scene, whether its scripts run, and its takes."""

    path: Path
    scene: Path
    takes: list[JobTake]
    scripts: bool = False


def read_job(path: str | Path) -> Job:
    """Read a job file; paths in it are relative to it.

    Raises JobError when the file as a whole is of no use.  What is wrong with one take is kept in that
    take's ``error``, so that the others go on.
    """
    require_name(Path(path), "The job file")
    path = Path(path).resolve()
    data = read_toml(path, JobError, "check the path of the job file")
    _known(data, _JOB_KEYS, "the job file")
    scene = _value(data, "scene", str, "the job file", required=True)
    require_name(Path(scene), "'scene' in the job file")
    scripts = _value(data, "scripts", bool, "the job file", default=False)
    entries = data.get("take")
    if not isinstance(entries, list) or not entries or not all(isinstance(e, dict) for e in entries):
        raise JobError("The job file has no takes; add at least one [[take]].")
    takes = [_take(entry, number, path.parent) for number, entry in enumerate(entries, 1)]
    job = Job(path, path.parent / scene, takes, scripts)
    _refuse_inputs(job)
    _refuse_clashes(takes)
    return job


def _take(entry: dict[str, Any], number: int, folder: Path) -> JobTake:
    name = entry.get("name")
    take = JobTake(name if isinstance(name, str) and name.strip() and name.isprintable() and len(name) <= 200 else f"take {number}")
    where = f"take '{take.name}'"
    try:
        if "report" in entry:
            take.outputs["report"] = _path(entry, "report", where, folder)  # first, so that an error below can be reported there
        _known(entry, _TAKE_KEYS, where)
        if _value(entry, "name", str, where, required=True) != take.name:
            raise JobError(f"'name' of {where} is {shown(name)}; give a plain name of at most 200 letters.")
        take.character = _value(entry, "character", str, where, default=take.character)
        take.seed = _whole(entry, "seed", where, take.seed, 0, MOST_SEED)
        take.start_frame = _whole(entry, "start_frame", where, take.start_frame, -MOST_FRAME, MOST_FRAME)
        take.contact_ik = _value(entry, "contact_ik", bool, where, default=take.contact_ik)
        take.overwrite = _value(entry, "overwrite", bool, where, default=take.overwrite)
        for key in OUTPUTS:
            if key in entry:
                take.outputs[key] = _path(entry, key, where, folder)
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
    asked = _value(entry, "action", str, where, required=True)
    try:
        action = require_action(asked if len(asked) <= 40 and asked.isprintable() else shown(asked))
    except NsmError as error:
        raise JobError(f"In {where}: {error}") from error
    target = _value(entry, "object", str, where, required=action.needs_object)
    to = _value(entry, "to", str, where, required=action.needs_destination)
    if to is not None and not action.needs_destination:
        raise JobError(f"In {where}, 'to' says where a box is carried; remove it, or take the action 'carry'.")
    hold = _value(entry, "hold", (int, float), where, default=2.0)
    if not is_number(hold, 0, 600):
        raise JobError(f"In {where}, 'hold' is {shown(hold)}; give seconds from 0 to 600.")
    location = _value(entry, "location", list, where)
    if location is not None and (len(location) != 3 or not all(is_number(v, -FAR, FAR) for v in location)):
        raise JobError(f"In {where}, 'location' is {shown(location)}; it needs three numbers within {FAR:,.0f}, such as [1.0, 2.0, 0.0].")
    if location is not None and action.needs_object:
        raise JobError(f"In {where}, '{action.key}' needs its 'object' alone; remove 'location', or place the object there.")
    if action.key in ("walk", "run") and target is None and location is None:
        raise JobError(f"In {where}, '{action.key}' needs an 'object' or a 'location'; add one.")
    if action.key == "idle" and (target or location):
        raise JobError(f"In {where}, 'idle' stands where the character is; take 'walk' with a 'hold' to stand at an object or a place.")
    return JobGoal(action.key, target, float(hold), tuple(map(float, location)) if location else None, to)


def _refuse_inputs(job: Job) -> None:
    """Mark takes that would write over the job file, or over the scene without being told to."""
    file, scene = identities(job.path), identities(job.scene)
    for take in job.takes:
        for key, path in list(take.outputs.items()):
            own = identities(path)
            if own & file:
                error = f"In take '{take.name}', '{key}' is the job file itself; give it a file of its own."
            elif not own & scene or (key == "out" and take.overwrite):
                continue
            elif key == "out":
                error = f"In take '{take.name}', 'out' is the scene itself; give it a file of its own, or add overwrite = true."
            else:
                error = f"In take '{take.name}', '{key}' is the scene itself; give it a file of its own."
            take.error = take.error or error
            del take.outputs[key]


def _refuse_clashes(takes: list[JobTake]) -> None:
    """Mark takes that would write over a file of an earlier take, or over their own."""
    seen: dict[object, str] = {}
    for take in takes:
        for key, path in list(take.outputs.items()):
            own = identities(path)
            earlier = next((seen[part] for part in own if part in seen), None)
            if earlier:
                take.error = take.error or f"In take '{take.name}', '{key}' is the same file as {earlier}; give each output its own."
                del take.outputs[key]
            else:
                seen |= dict.fromkeys(own, f"'{key}' of take '{take.name}'")


def _path(entry: dict[str, Any], key: str, where: str, folder: Path) -> Path:
    """The file that a key names, relative to the job file."""
    path = folder / _value(entry, key, str, where)
    if key in _ENDINGS and path.name and path.suffix.lower() != _ENDINGS[key]:
        path = path.with_name(path.name + _ENDINGS[key])
    require_name(path, f"'{key}' of {where}")
    if key in ("report", "bvh") and path.suffix.lower() in (".blend", ".toml"):
        raise JobError(f"'{key}' of {where} is {shown(path.name)}, a name of scenes and job files; give it the ending of its own kind.")
    return path


def _whole(entry: dict[str, Any], key: str, where: str, default: int, low: int, high: int) -> int:
    value = _value(entry, key, int, where, default=default)
    if not low <= value <= high:
        raise JobError(f"The key '{key}' in {where} is {shown(value)}; give a whole number from {low} to {high}.")
    return value


def _known(entry: dict[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in entry:
        if key not in keys:
            raise JobError(f"The key {shown(key)} in {where} is unknown; the keys are {', '.join(keys)}.")


def _value(entry: dict[str, Any], key: str, kind: Any, where: str, *, required: bool = False, default: Any = None) -> Any:
    if key not in entry:
        if required:
            raise JobError(f"The key '{key}' is missing in {where}; add it.")
        return default
    value = entry[key]
    if not _is(value, kind) or value == "":
        raise JobError(f"The key '{key}' in {where} is {shown(value)}; {_WORDS[kind]} is needed.")
    return value


def _is(value: Any, kind: Any) -> bool:
    return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))


_WORDS = {str: "a text in quotes", int: "a whole number", bool: "true or false", list: "a list", (int, float): "a number"}
