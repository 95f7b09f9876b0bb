"""What is done in a generated kitchen: tea is made, or things that are shut away are brought to the table."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from nsm_core.errors import NsmError
from nsm_core.world.assets.kitchen import Kitchen

from ..goals.fronts import shut_away
from ..goals.resolve import resolve
from ..goals.spec import GoalSpec
from ..prepare import start_of
from .kitchen import titled

TEA = 1418  # the seed of a kitchen in which a hand gets at all that tea is made of
_MUG, _BEHIND, _JARS = "mug", "bowl", ("jar", "spice jar", "tea caddy")


def kitchen_goals(kitchen: Kitchen, character: bpy.types.Object, scene: bpy.types.Scene) -> list[GoalSpec]:
    """Goals to make tea: a mug from behind a bowl in a cupboard, and a jar out of a drawer, to the worktop.

    Where a hand does not get at both, the first thing behind a door and the first in a drawer that it gets
    at, to the table; empty where there is neither.  What is opened for them is shut again.
    """
    goals: list[GoalSpec] = []
    for to, wanted in (("worktop", (_is_mug, _is_jar)), ("table", (_is_behind_door, _is_in_drawer))):
        goals = []
        for fits in wanted:
            names = [name for name in kitchen.things if fits(kitchen, name)]
            goals += _first(names, scene.objects[titled(to)], character, scene)
        if len(goals) == len(wanted):
            break
    return goals


def _first(
    names: Sequence[str], to: bpy.types.Object, character: bpy.types.Object, scene: bpy.types.Scene
) -> list[GoalSpec]:
    """The goal to bring the first of some things that a hand gets at once one front is open; else none."""
    for name in names:
        goal = GoalSpec("place", scene.objects[titled(name)], 0.0, to=to)
        if len(shut_away(goal.object)) == 1 and _can_be(goal, character, scene):
            return [goal]
    return []


def _kinds(kitchen: Kitchen, name: str) -> set[str]:
    """Kinds of the parts that shut a thing away."""
    container = kitchen.containers[kitchen.things[name].container]
    return {container.part(part).kind for part in kitchen.shut_by(name)}


def _is_in_drawer(kitchen: Kitchen, name: str) -> bool:
    return _kinds(kitchen, name) == {"drawer"}


def _is_behind_door(kitchen: Kitchen, name: str) -> bool:
    return bool(_kinds(kitchen, name)) and not _is_in_drawer(kitchen, name)


def _is_mug(kitchen: Kitchen, name: str) -> bool:
    standing = kitchen.things[name]
    blocked = any(kitchen.things[other].thing.kind == _BEHIND for other in standing.blockers)
    return standing.thing.kind == _MUG and blocked and _is_behind_door(kitchen, name)


def _is_jar(kitchen: Kitchen, name: str) -> bool:
    return kitchen.things[name].thing.kind in _JARS and _is_in_drawer(kitchen, name)


def _can_be(goal: GoalSpec, character: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    frame, start = start_of(character, scene)
    try:
        resolve(goal, scene, frame, start)
    except NsmError:
        return False
    return True
