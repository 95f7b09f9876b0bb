"""What can be told of a take before it is made: what is solid, which goals can be done, and the ways to
them.
"""

from __future__ import annotations

from collections.abc import Collection, Generator
from dataclasses import dataclass, field, replace

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.control.actions.registry import standing_places
from nsm_core.control.goals import Goal
from nsm_core.errors import GoalError, NsmError
from nsm_core.rotations import Array
from nsm_core.world.planning.floor_plan import FloorPlan

from .goals.resolve import moved_by, place_after, require_possible, require_room_for, resolve
from .goals.spec import GoalSpec
from .keys.objects import require_movable, rides_along
from .prepare import TakeSpec, start_of, surroundings_of
from .progress import Progress, staged, waited
from .world.beside import beside
from .world.frame import WorldFrame
from .world.surroundings import Surroundings

_MARGIN = 4.0  # metres of floor planned on around the places, as for a take
_STEP = 0.3  # metres between two places that are one


@dataclass
class GoalOutlook:
    """What is known of a goal before its take: the core's ``goal``, or the ``problem`` in a sentence; the
    ``ways`` (N, 2) over the floor to it, core frame.  ``place`` (3,), world, is over its object, or where it
    was asked for.
    """

    spec: GoalSpec
    goal: Goal | None = None
    problem: str = ""
    ways: list[Array] = field(default_factory=list)
    place: Array | None = None


@dataclass
class Outlook:
    """The scene around a character as a take would see it, and what becomes of its goals there.

    ``placed``: world matrices (4, 4) of what is solid, by the objects' full names.
    """

    frame: WorldFrame
    around: Surroundings
    start: Array  # (2,) core frame
    goals: list[GoalOutlook]
    placed: dict[str, Array] = field(default_factory=dict)


def outlook(spec: TakeSpec, scene: bpy.types.Scene) -> Generator[Progress, None, Outlook]:
    """Look at a take's goals in the scene as it is now, in slices; the generator's value is the Outlook.

    Nothing in the file changes.  A goal that cannot be done is told in its own sentence, and those after it
    begin where the one before it ends.  Raises SkeletonError where the character cannot act at all.
    """
    frame, start = start_of(spec.character, scene)
    now = replace(spec, start_frame=scene.frame_current_final)
    moving = moved_by(spec.goals)
    around = yield from surroundings_of(now, scene, frame, moving)
    alone = [o for o in moving if not rides_along(o, moving)]
    found, before = [], start
    for goal in spec.goals:
        steps = beside(lambda _, goal=goal, before=before: _found(goal, scene, around, before, alone), True)
        told, before = yield from staged("Finding the goals", steps)
        found.append(told)
    seen = Outlook(frame, around, start[0], found, placed_now(scene, {s.owner for s in around.solids}))
    query = around.query
    yield from waited("Planning the ways", lambda _: _plan(seen, query))
    return seen


def placed_now(scene: bpy.types.Scene, names: Collection[str]) -> dict[str, Array]:
    """World matrices (4, 4) of a scene's objects at its present frame, by their full names."""
    return {
        o.name_full: np.array(o.matrix_world, dtype=np.float64) for o in scene.objects if o.name_full in names
    }


def _found(
    spec: GoalSpec,
    scene: bpy.types.Scene,
    around: Surroundings,
    before: tuple[Array, float],
    moving_alone: list[bpy.types.Object],
) -> tuple[GoalOutlook, tuple[Array, float]]:
    """One goal, and where it leaves the character."""
    place = _place_of(spec)
    try:
        require_possible([spec], scene)
        if spec.object in moving_alone:
            require_movable(spec.object, around.character)
        goal = resolve(spec, scene, around.frame, before, around)
        require_room_for(goal, around.query)
        return GoalOutlook(spec, goal, place=place), place_after(goal, before, around)
    except NsmError as error:
        return GoalOutlook(spec, problem=str(error), place=place), before


def _place_of(spec: GoalSpec) -> Array | None:
    target = spec.object
    if target is None:
        return None if spec.location is None else np.array(spec.location)
    corners = np.array([target.matrix_world @ Vector(c) for c in target.bound_box])
    return np.append(corners[:, :2].mean(0), corners[:, 2].max())


def _plan(seen: Outlook, query: object) -> None:
    """Lay the ways to all goals; one to which none leads gets its sentence."""
    goals = [told.goal for told in seen.goals if told.goal is not None]
    if not goals:
        return
    places = np.array(
        [
            seen.start,
            *(g.position[:2] for g in goals),
            *(g.prop.pose[:2] for g in goals if g.prop is not None),
        ]
    )
    plan = FloorPlan(query, (places.min(0) - _MARGIN, places.max(0) + _MARGIN))
    here, poses = np.asarray(seen.start, dtype=np.float64), {}
    for told in seen.goals:
        if told.goal is None:
            continue
        try:
            asked, there = True, here
            for place in standing_places(told.goal, here, plan, poses, query):
                if place is not None and asked and np.linalg.norm(place - there) > _STEP:
                    told.ways.append(plan.find(there, place))
                asked, there = place is not None, there if place is None else place
            here = there
        except GoalError as error:
            told.problem = str(error)
