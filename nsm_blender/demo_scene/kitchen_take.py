"""What is done in a generated kitchen: things that are shut away are brought to the table, and what was
opened for them is shut again.
"""

from __future__ import annotations

import bpy

from nsm_core.errors import NsmError
from nsm_core.world.assets.kitchen import Kitchen

from ..goals.fronts import shut_away
from ..goals.resolve import resolve
from ..goals.spec import GoalSpec
from ..prepare import start_of
from .kitchen import titled

TABLE = "table"


def kitchen_goals(kitchen: Kitchen, character: bpy.types.Object, scene: bpy.types.Scene) -> list[GoalSpec]:
    """Goals to take the first thing behind a door, and the first in a drawer, that a hand gets at, to the
    table, each with what was opened shut after it.  Empty where there is neither.
    """
    table = scene.objects[titled(TABLE)]
    goals: list[GoalSpec] = []
    for drawer in (False, True):
        for name, standing in kitchen.things.items():
            kinds = {kitchen.containers[standing.container].part(p).kind for p in kitchen.shut_by(name)}
            if not kinds or (kinds == {"drawer"}) != drawer:
                continue
            place = GoalSpec("place", scene.objects[titled(name)], 0.0, to=table)
            fronts = shut_away(place.object)
            if len(fronts) == 1 and _can_be(place, character, scene):
                goals += [place, GoalSpec("open", fronts[0], 0.0)]
                break
    return goals


def _can_be(goal: GoalSpec, character: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    frame, start = start_of(character, scene)
    try:
        resolve(goal, scene, frame, start)
    except NsmError:
        return False
    return True
