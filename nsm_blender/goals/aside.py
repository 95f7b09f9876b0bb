"""Things in a scene that block another one: they are put aside before it is taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
from .light_things import read_thing


def put_aside_first(
    goal: Goal,
    target: bpy.types.Object,
    around: Surroundings,
    plan: FloorPlan,
    here: Array,
    refused: NsmError,
) -> Goal:
    """The goal to take ``target``, which cannot be taken as it stands, with goals before it that put aside
    what blocks it.  Raises ``refused`` where nothing that a hand may move helps.
    """
    objects = {thing.name: (o, thing) for o, thing in _neighbours(target, around)}
    if not objects:
        raise refused
    still = around.query_but(*(o for o, _ in objects.values()))
    still = but_moved(around, target.name, standing=still)
    things = [thing for _, thing in objects.values()]

    def solids(gone: Sequence[LightThing]) -> DistanceQuery:
        names = {one.name for one in gone}
        return Union([still, *(one for one in things if one.name not in names)])

    found = with_aside(goal, things, solids, plan, here, refused)
    aside = [one for one in found.first if one.picking is not None]
    around.move_too(*(objects[one.name][0] for one in aside))
    for one in aside:
        assert one.picking is not None
        around.left[objects[one.name][0]] = objects[one.name][1], one.picking.pose
    return found


def _neighbours(
    target: bpy.types.Object, around: Surroundings
) -> Iterator[tuple[bpy.types.Object, LightThing]]:
    """Light things close to an object that a take may move and no goal has moved by then."""
    scale = around.frame.scale
    at = np.array(target.matrix_world.translation)
    own = {target, *target.children_recursive}
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
            yield other, thing


__all__ = ["put_aside_first"]
