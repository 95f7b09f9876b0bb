"""A shelf and a table, small things that are taken from one to the other, and a job that asks for it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
from scenes import box, mesh_of_boxes

from nsm_blender.batch import main
from nsm_blender.goals.resolve import moved_by
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.prepare import TakeSpec, resolve_goals, start_of, surroundings_of
from nsm_blender.progress import finish


def shelf_and_table() -> None:
    """A shelf of two boards, 0.98 and 1.38 m high, and a table of 0.75 m beside it."""
    shelf = [
        ((-0.4, 0.0, 0.95), (0.4, 0.3, 0.98)),
        ((-0.4, 0.0, 1.35), (0.4, 0.3, 1.38)),
        ((-0.4, 0.3, 0.0), (0.4, 0.32, 1.8)),
    ]
    mesh_of_boxes("Shelf", shelf)
    box("Table", (1.0, -1.6, 0.0), (2.0, -0.9, 0.75))


def small_thing(name: str, foot: tuple[float, float, float], half: float = 0.035, height: float = 0.12):
    """An upright thing of a square foot, whose middle stands at ``foot``."""
    return mesh_of_boxes(name, [((-half, -half, 0.0), (half, half, height))], foot)


def performed(folder: Path, character: str, *things: str) -> dict[str, Any]:
    """The report of a job that has a character of the open file put ``things`` on the table; the file that it
    wrote is open then.
    """
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "room.blend"))
    goals = "".join(
        f'    {{ object = "{thing}", action = "place", to = "Table", hold = 0.2 }},\n' for thing in things
    )
    (folder / "job.toml").write_text(
        f"""scene = "room.blend"
[[take]]
name = "place"
character = "{character}"
seed = 2
goals = [
{goals}]
out = "out.blend"
report = "out.json"
""",
        encoding="utf-8",
    )
    assert main([str(folder / "job.toml")]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(folder / "out.blend"))
    return json.loads((folder / "out.json").read_text(encoding="utf-8"))


def found(character: bpy.types.Object, *goals: GoalSpec):
    """The goals of a character of the open file with all that belongs to them, as a take would plan them."""
    scene, spec = bpy.context.scene, TakeSpec(character, list(goals))
    frame, start = start_of(character, scene)
    around = finish(surroundings_of(spec, scene, frame, moved_by(spec.goals)))
    return resolve_goals(spec, scene, frame, start, around)


def place(name: str, to: str = "Table", **more: Any) -> GoalSpec:
    """A goal that has one object put onto another."""
    return GoalSpec("place", bpy.data.objects[name], 0.0, to=bpy.data.objects[to], **more)
