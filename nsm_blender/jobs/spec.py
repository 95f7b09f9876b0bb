"""A take of a job file in its scene: the objects that its entry names, and what it asks for of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy

from nsm_core.errors import GoalError, JobError, SkeletonError

from ..fill.spec import FillSpec
from ..goals.spec import GoalSpec
from ..prepare import TakeSpec
from ..rigs.bone_map import store_map
from ..rigs.detect import judged_on
from ..rigs.presets import load_preset, named_preset
from ..takes import Take
from ..together import GroupSpec
from .job import JobFill, JobGoal, JobTake


def spec_of(entry: JobTake, scene: bpy.types.Scene) -> TakeSpec:
    """What to generate for an entry; JobError, SkeletonError and GoalError say what the scene lacks."""
    return TakeSpec(
        character=_dressed(entry, scene),
        goals=[_goal(scene, g) for g in entry.goals],
        name=entry.name,
        start_frame=entry.start_frame,
        seed=entry.seed,
        contact_ik=entry.contact_ik,
        in_order=entry.in_order,
        begin=entry.start,
        root_motion=entry.root_motion,
        reduce=entry.reduce,
    )


def fill_of(entry: JobTake, gap: JobFill, scene: bpy.types.Scene) -> FillSpec:
    """What to fill for an entry; raises as ``spec_of``."""
    character = _dressed(entry, scene)
    return FillSpec(
        character,
        gap.start,
        gap.end,
        seed=entry.seed,
        replace=gap.replace,
        method=gap.method,
        name=entry.name,
    )


def group_of(entry: JobTake, scene: bpy.types.Scene) -> GroupSpec:
    """What to generate for an entry of several characters; raises as ``spec_of``."""
    return GroupSpec(
        [
            spec_of(replace(entry, name="", character=name, goals=goals, seed=entry.seed + number), scene)
            for number, (name, goals) in enumerate(entry.characters)
        ]
    )


def merged(takes: list[Take], group: GroupSpec) -> Take:
    """Several takes that were made together as the one that a job's entry stands for: the longest, with the
    report of all.
    """
    names = [spec.character.name for spec in group.takes]
    reports = [{"character": name, **take.report} for name, take in zip(names, takes, strict=True)]
    longest = max(takes, key=lambda take: take.keyed.frame_end)
    goals = [{"character": r["character"], **goal} for r in reports for goal in r["goals"]]
    return replace(longest, report={**longest.report, "goals": goals, "characters": reports})


def open_scene(path: Path, scripts: bool) -> bpy.types.Scene:
    """Open the scene of a job; JobError where that fails."""
    if not path.is_file():
        raise JobError(f"The scene {path} does not exist; correct 'scene' in the job file.")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=scripts)
    except RuntimeError as error:
        raise JobError(
            f"The scene {path} cannot be opened by Blender {bpy.app.version_string}; save it again with "
            "this version."
        ) from error
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    return scene


def _dressed(entry: JobTake, scene: bpy.types.Scene) -> bpy.types.Object:
    """The armature of an entry, with the bone map that it asks for."""
    character = _armature(scene, entry.character)
    if entry.rig:
        _wear(character, entry.rig)
    return character


def _named(scene: bpy.types.Scene, name: str) -> bpy.types.Object | None:
    """The scene's object of that name; where a linked one has it too, the scene's own."""
    return min(
        (o for o in scene.objects if o.name == name), key=lambda o: o.library is not None, default=None
    )


def _armature(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    found = _named(scene, name)
    if found is None:
        there = [o.name for o in scene.objects if o.type == "ARMATURE"]
        raise SkeletonError(
            f"The scene has no character '{name}'; its armatures are {', '.join(there) or 'none'}: correct "
            "'character'."
        )
    return found


def _goal(scene: bpy.types.Scene, goal: JobGoal) -> GoalSpec:
    to = _target(scene, goal.to, "to")
    if goal.curve is not None:
        curve = _target(scene, goal.curve, "curve")
        return GoalSpec(
            goal.action, curve, goal.hold, along=True, rounds=goal.rounds, speed=goal.speed, by=goal.by
        )
    target = _target(scene, goal.object)
    return GoalSpec(
        goal.action,
        target,
        goal.hold,
        goal.location,
        to,
        speed=goal.speed,
        by=goal.by,
        mass=goal.mass,
        close_after=goal.close_after,
    )


def _wear(character: bpy.types.Object, rig: str | Path) -> None:
    """Give a character the bone map of a preset or a file; SkeletonError where its bones do not fit."""
    if character.type != "ARMATURE":
        return  # refused with what else may be wrong with it
    preset = load_preset(rig) if isinstance(rig, Path) else named_preset(rig)
    bone_map = preset.on(character.data.bones)
    problem = bone_map.problem(character.name, character.data.bones)
    if problem:
        raise SkeletonError(f"By the bone map {preset.name}: {problem}")
    store_map(character.data, judged_on(character.data, bone_map))


def _target(scene: bpy.types.Scene, name: str | None, key: str = "object") -> bpy.types.Object | None:
    if name is None:
        return None
    found = _named(scene, name)
    if found is None:
        kinds = {"CURVE"} if key == "curve" else {"MESH", "EMPTY"}
        there = sorted(o.name for o in scene.objects if o.type in kinds)
        listed = ", ".join(there[:12]) + (", ..." if len(there) > 12 else "")
        raise GoalError(
            f"The scene has no {'curve' if key == 'curve' else 'object'} '{name}'; it has "
            f"{listed or 'none'}: correct '{key}'."
        )
    return found
