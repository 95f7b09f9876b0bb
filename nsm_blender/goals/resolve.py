"""From a Blender object and an action to a goal that the core understands."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.world.actions import Aim, require_action
from nsm_core.world.geometry.distance import DistanceQuery

from ..world.frame import WorldFrame, holds
from ..world.surroundings import Surroundings
from .finder import Place
from .points import POINT_ACTION, POINT_LINK, POINT_NAME, POINT_TO, goal_point_of, make_point
from .registry import FINDERS
from .spec import GoalSpec

__all__ = [
    "POINT_ACTION",
    "POINT_LINK",
    "goal_point_of",
    "moved_by",
    "place_after",
    "require_room_for",
    "resolve",
    "show_goal_point",
]


def moved_by(specs: list[GoalSpec]) -> list[bpy.types.Object]:
    """The objects that goals move, each once: boxes that are carried, and leaves that are opened with what
    hangs on them.
    """
    moved = [s for s in specs if s.object is not None and require_action(s.action).moves]
    parts = [part for s in moved for part in (s.object, *FINDERS[s.action].parts(s.object))]
    return list(dict.fromkeys(parts))


def resolve(
    spec: GoalSpec,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    before: Place,
    around: Surroundings | None = None,
) -> Goal:
    """Build the core's goal: all positions in the core's frame of the character (``frame``).

    ``before`` is the ground point (2,) and heading from which the character will come, core frame; ``around``
    the scene with what earlier goals have moved (read anew without it).
    Raises GoalError where the object is missing or out of reach, GeometryError where its mesh is of no use.
    """
    action = require_action(spec.action)
    if spec.object is None and (action.needs_object or action.aim is Aim.PLACE and spec.location is None):
        raise GoalError(f"A goal to {spec.action} has no object; choose one, or remove the goal.")
    if action.needs_destination and spec.to is None:
        raise GoalError(
            f"A goal to {spec.action} {spec.label} has no destination; choose the object or empty where it "
            "goes."
        )
    for kind, needed in (
        ("goal object", spec.object),
        ("destination", spec.to if action.needs_destination else None),
    ):
        if needed is not None and not holds(scene, needed):
            raise GoalError(
                f"The {kind} {needed.name} is no longer in the scene; choose another object, or remove the "
                "goal."
            )
    around = around or Surroundings(scene, frame, moving=moved_by([spec]))
    return FINDERS[spec.action].find(spec, scene, around, before)


def require_possible(goals: Sequence[GoalSpec], scene: bpy.types.Scene) -> None:
    """Raise GoalError on the first goal that cannot be, as far as that can be told before the scene
    is read.
    """
    for spec in goals:
        FINDERS[require_action(spec.action).key].require(spec, scene)


def require_room_for(goal: Goal, solids: DistanceQuery) -> None:
    """Raise GoalError where ``solids`` leave no room to do what a goal asks for."""
    FINDERS[goal.action].room(goal, solids)


def place_after(goal: Goal, before: Place, around: Surroundings) -> Place:
    """Ground point (2,) and heading where a goal, resolved last in ``around``, leaves the character that came
    from ``before``.
    """
    return FINDERS[goal.action].after(goal, before, around)


def show_goal_point(
    spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: Place,
    around: Surroundings | None = None, told: list[str] | None = None,
) -> bpy.types.Object:  # fmt: skip
    """Return the editable goal point of a goal's object, made from the mesh on the first call.

    It marks the middle of the hips' place on the seat, the place where a box is set down or one stands, or
    the ground point, and looks along its -Y.  A door has two: its hinge, which is returned, and its handle.
    They are children of the object (a box's of the destination) and go where it goes.  Where no place is
    found, one is made all the same, to be moved, and ``told`` hears why in a sentence; so it is of a place
    that is of no use.  Raises as ``resolve`` does where there is nothing that could have a point.
    """
    around = around or Surroundings(scene, frame, moving=moved_by([spec]))
    return make_goal_point(spec, scene, frame, around, *sought(spec, scene, frame, before, around), told)


def sought(
    spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: Place, around: Surroundings
) -> tuple[Goal | None, str]:
    """The goal whose point is to be shown; None, with the reason in a sentence, where none is found on an
    object that has one.
    """
    try:
        return resolve(spec, scene, frame, before, around), ""
    except (GoalError, GeometryError) as error:
        if spec.object is None or not all(o is None or holds(scene, o) for o in (spec.object, spec.to)):
            raise
        return None, str(error)


def make_goal_point(
    spec: GoalSpec,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    around: Surroundings,
    goal: Goal | None,
    reason: str,
    told: list[str] | None = None,
) -> bpy.types.Object:
    """The point of what was ``sought``; see ``show_goal_point``."""
    finder, brought = FINDERS[spec.action], require_action(spec.action).needs_destination
    if finder.show is not None:
        return finder.show(spec, goal, around.body(spec.object, snug=True), reason, scene, frame, told)
    existing = goal_point_of(scene, spec.object, spec.action, spec.to if brought else None)
    if existing is not None or brought and spec.to is not None and spec.to.type == "EMPTY":
        if reason and told is not None:
            told.append(reason)
        return existing or spec.to
    holder = spec.to if brought else spec.object
    if holder is None:
        raise GoalError(reason)
    if goal is None:
        position, heading = finder.somewhere(around.body(holder))
    else:
        position, heading = np.array(goal.position, dtype=np.float64), goal.heading
        position[2] -= finder.under(goal)
    point = make_point(
        f"{POINT_NAME} {spec.object.name}", spec.object, spec.action, position, heading, frame, holder
    )
    if brought:
        point[POINT_TO] = spec.to
    if goal is None and told is not None:
        told.append(
            f"{reason} {point.name} was put on {holder.name} all the same: move it to where it should be."
        )
    bpy.context.view_layer.update()
    return point
