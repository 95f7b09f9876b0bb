"""What is done in a generated kitchen: tea is made, or things that are shut away are brought to the table."""

from __future__ import annotations

import bpy

from nsm_core.errors import NsmError
from nsm_core.world.assets.kitchen import Kitchen
from nsm_core.world.assets.tea_kitchen import JAR, MUG, TEA

from ..goals.fronts import shut_away
from ..goals.resolve import resolve
from ..goals.spec import GoalSpec
from ..prepare import start_of
from .kitchen import titled

WORKTOP, TABLE = "worktop", "table"
_STANDS = 1.5  # seconds in the end, in which one stands up from the drawer


def kitchen_goals(kitchen: Kitchen, character: bpy.types.Object, scene: bpy.types.Scene) -> list[GoalSpec]:
    """Goals to take the first thing behind a door, and the first in a drawer, that a hand gets at, to the
    table; in the kitchen for tea, its mug and its jar to the worktop.  What is opened for them is shut again.
    Empty where there is neither.
    """
    if kitchen.seed == TEA:
        return [_bring(MUG, WORKTOP, scene), _bring(JAR, WORKTOP, scene, hold=_STANDS)]
    goals: list[GoalSpec] = []
    for drawer in (False, True):
        for name, standing in kitchen.things.items():
            kinds = {kitchen.containers[standing.container].part(p).kind for p in kitchen.shut_by(name)}
            if not kinds or (kinds == {"drawer"}) != drawer:
                continue
            goal = _bring(name, TABLE, scene)
            if len(shut_away(goal.object)) == 1 and _can_be(goal, character, scene):
                goals.append(goal)
                break
    return goals


def _bring(name: str, to: str, scene: bpy.types.Scene, hold: float = 0.0) -> GoalSpec:
    return GoalSpec("place", scene.objects[titled(name)], hold, to=scene.objects[titled(to)])


def _can_be(goal: GoalSpec, character: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    frame, start = start_of(character, scene)
    try:
        resolve(goal, scene, frame, start)
    except NsmError:
        return False
    return True
