"""The queue of goals that the sidebar shows: the chosen character's own, which goes where the character
goes.
"""

from __future__ import annotations

from typing import Any

import bpy

from nsm_core.world.actions import BY_KEY


def queue_of(scene: bpy.types.Scene) -> Any:
    """Return what holds the ``goals`` and the ``active_goal`` that the sidebar shows, the chosen character's.

    The scene's own serve without a character, with one that is linked and no override, and while the chosen
    one has none: files of earlier versions and scripts keep their rows there.
    """
    settings = scene.nsm
    if settings.character is None or settings.character.library is not None:  # which nothing is written to
        return settings
    own = settings.character.nsm_queue
    return own if len(own.goals) or not len(settings.goals) else settings


def flow_on(goal: Any) -> None:
    """Have a new row go on to the next one without a stay, where its action is a stretch of the way."""
    if not BY_KEY[goal.action].stays:
        goal.hold = 0.0


def cast_of(scene: bpy.types.Scene) -> list[tuple[bpy.types.Object, Any]]:
    """The characters of a scene that have enabled goals, by their names, each with its queue."""
    armatures = sorted((o for o in scene.objects if o.type == "ARMATURE"), key=lambda o: o.name)
    queues = [(o, queue_of(scene) if o == scene.nsm.character else o.nsm_queue) for o in armatures]
    return [(o, queue) for o, queue in queues if any(goal.enabled for goal in queue.goals)]


def hand_over(settings: Any) -> None:
    """Give the rows that a scene holds to its character, where that one has none and can be written."""
    character = settings.character
    if character is None or character.library is not None:
        return
    if not len(settings.goals) or len(character.nsm_queue.goals):
        return
    queue = character.nsm_queue
    for row in settings.goals:
        copied = _stored(queue.goals.add())
        for name, value in _stored(row).items():
            copied[name] = value
    queue.active_goal = settings.active_goal
    settings.goals.clear()
    settings.active_goal = 0


def _stored(row: Any) -> Any:
    """What a file holds of a row, by name: as it is, the number of an action that this version does not know
    too.
    """
    return row.bl_system_properties_get(do_create=True) if hasattr(row, "bl_system_properties_get") else row
