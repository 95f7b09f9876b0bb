"""Things in a scene that block another one: they are put aside before it is taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.control.aside import with_aside
from nsm_core.control.goals import Goal
from nsm_core.errors import NsmError
from nsm_core.rotations import Array
from nsm_core.world.affordances.clearing import NEIGHBOUR
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.small_things import HEAVIEST, LARGEST

from ..keys.objects import require_movable
from ..world.surroundings import Surroundings
from .fronts import but_moved
from .light_things import read_thing, riding


def put_aside_first(
    goal: Goal,
    target: bpy.types.Object,
    there: LightThing,
    around: Surroundings,
    plan: FloorPlan,
    here: Array,
    refused: NsmError,
) -> Goal:
    """The goal to take ``target``, which cannot be taken as it stands ``there`` by then, with goals before it
    that put aside what blocks it.  Raises ``refused`` where nothing that a hand may move helps.
    """
    objects = {thing.name: (o, thing, now) for o, thing, now in _neighbours(target, there, around)}
    if not objects:
        raise refused
    still = around.query_but(*(o for o, *_ in objects.values()))
    still = but_moved(around, target.name, *objects, standing=still)
    things = [now for *_, now in objects.values()]

    def solids(gone: Sequence[LightThing]) -> DistanceQuery:
        names = {one.name for one in gone}
        return Union([still, *(one for one in things if one.name not in names)])

    found = with_aside(goal, there, things, solids, plan, here, refused)
    first = list[Goal]()
    for one in found.first:
        if one.picking is not None:  # a thing is a prop where the take finds it
            moved, prop, _ = objects[one.name]
            around.move_too(moved)
            around.left[moved] = prop, one.picking.pose
            one = replace(one, prop=prop)
        first.append(one)
    return replace(found, first=tuple(first))


def _neighbours(
    target: bpy.types.Object, there: LightThing, around: Surroundings
) -> Iterator[tuple[bpy.types.Object, LightThing, LightThing]]:
    """Light things close to where an object stands by then, ``there``, that a take may move and no goal has
    taken by then: each as the scene has it, and where it stands by then.
    """
    scale = around.frame.scale
    at = around.frame.to_world(there.middle)
    own = {target, *target.children_recursive}
    for other, thing, now in riding(around):
        near = np.linalg.norm((now.middle - there.middle)[:2]) < NEIGHBOUR + LARGEST
        if other not in own and near and now.size.max() <= LARGEST and now.mass <= HEAVIEST:
            with suppress(NsmError):
                require_movable(other, around.character)
                yield other, thing, now
    for other in around.scene.objects:
        if other.type != "MESH" or other.parent is not None or other in around.moving or other in own:
            continue
        size = max(other.dimensions) / scale
        middle = other.matrix_world @ (sum((Vector(c) for c in other.bound_box), Vector()) / 8)
        if not 0 < size <= LARGEST or not other.visible_get():
            continue
        if np.linalg.norm((np.array(middle) - at)[:2]) / scale > NEIGHBOUR + LARGEST:
            continue
        try:
            require_movable(other, around.character)
            thing = read_thing(other, around, None)
        except NsmError:
            continue
        if thing.mass <= HEAVIEST:
            yield other, thing, thing


__all__ = ["put_aside_first"]
