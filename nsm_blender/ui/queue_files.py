"""Queues of goals as files: a table a goal, objects by their names."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy

from nsm_core.errors import GoalError

_KIND = "queues"
_NOT_KEPT = {"rna_type", "name", "hold_frames"}  # the last follows from the seconds
_MOST = 200  # goals of a queue, and queues that are listed


def folder() -> Path:
    """Where queues are kept."""
    from ..user_folder import user_folder

    return user_folder(_KIND)


def saved() -> list[str]:
    """Names of the queues that are kept, in order."""
    return sorted(path.stem for path in folder().glob("*.toml"))[:_MOST]


def path_of(name: str) -> Path:
    """The file of a queue's name; GoalError where no file can be called that."""
    clean = bpy.path.clean_name(name.strip(), replace="-") if name.strip() else ""
    if not clean:
        raise GoalError("A queue needs a name; type one.")
    return folder() / f"{clean}.toml"


def save_queue(path: Path, rows: Any) -> None:
    """Write a queue, whole or not at all; OutputError where that fails."""
    from nsm_core.files import output

    lines = ["# A queue of goals; objects are found by their names."]
    for row in rows:
        lines += ["", "[[goal]]"]
        for prop in _kept(row):
            value = getattr(row, prop.identifier)
            if prop.type == "POINTER":
                value = value.name if value is not None else None
            elif getattr(prop, "is_array", False):
                value = [round(float(v), 6) for v in value]
            elif prop.type == "FLOAT":
                value = round(float(value), 6)
            if value not in (None, ""):
                lines.append(f"{prop.identifier} = {_toml(value)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    with output(path, "The queue") as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")


def load_queue(path: Path, queue: Any, scene: bpy.types.Scene) -> list[str]:
    """Replace the rows of ``queue`` by those of a file, and return the names of objects that the scene lacks.

    GoalError says which entry of the file is wrong; the rows are then as they were.
    """
    from nsm_core.validate import listed, read_toml, shown, table

    found = read_toml(path, GoalError)
    unknown = next((key for key in found if key != "goal"), None)
    if unknown is not None:
        raise GoalError(f"{path.name}: {shown(unknown)} is not known in a queue; write [[goal]] tables.")
    goals = listed(found.get("goal", []), f"{path.name}: goal", GoalError, _MOST)
    tables = [table(goal, f"{path.name}: goal {number}", GoalError) for number, goal in enumerate(goals, 1)]
    before, active = len(queue.goals), queue.active_goal
    missing: list[str] = []
    try:
        for number, goal in enumerate(tables, 1):
            _fill(queue.goals.add(), goal, f"{path.name}: goal {number}", scene, missing)
    except GoalError:
        while len(queue.goals) > before:
            queue.goals.remove(before)
        raise
    for _ in range(before):
        queue.goals.remove(0)
    queue.active_goal = min(active, max(len(queue.goals) - 1, 0))
    return list(dict.fromkeys(missing))


def _fill(row: Any, goal: dict[str, Any], where: str, scene: bpy.types.Scene, missing: list[str]) -> None:
    from nsm_core.validate import shown, text

    props = {prop.identifier: prop for prop in _kept(row)}
    for key, value in goal.items():
        prop = props.get(key)
        if prop is None:
            raise GoalError(f"{where}: {shown(key)} is not known; use {', '.join(props)}.")
        what = f"{where}: {key}"
        if prop.type == "POINTER":
            name = text(value, what, GoalError)
            target = scene.objects.get(name)
            if target is None:
                missing.append(name)
            setattr(row, key, target)
            continue
        if not _fits(prop, value):
            raise GoalError(f"{what} cannot be {shown(value)}.")
        setattr(row, key, value)


def _fits(prop: Any, value: object) -> bool:
    from nsm_core.validate import is_number

    if getattr(prop, "is_array", False):
        return isinstance(value, list) and len(value) == prop.array_length and all(map(is_number, value))
    if prop.type == "ENUM":
        return value in prop.enum_items.keys()
    if prop.type == "BOOLEAN":
        return isinstance(value, bool)
    if prop.type == "INT":
        whole = isinstance(value, int) and not isinstance(value, bool)
        return whole and prop.hard_min <= value <= prop.hard_max
    if prop.type == "FLOAT":
        return is_number(value, prop.hard_min, prop.hard_max)
    return isinstance(value, str)


def _kept(row: Any) -> list[Any]:
    """What a file holds of a row: all that can be set and follows from nothing else."""
    return [
        prop
        for prop in row.bl_rna.properties
        if prop.identifier not in _NOT_KEPT and not prop.is_readonly and prop.type != "COLLECTION"
    ]


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | list) else repr(value)
