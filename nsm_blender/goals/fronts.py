"""Doors, drawers and slides of furniture that a hand opens and shuts: which objects are such, what goes along
with them, and what of them shuts a thing away.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.control.actions.unshut import planned
from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import Prop

from ..world.evaluated import family_of
from ..world.frame import WorldFrame
from ..world.surroundings import Surroundings
from .door_kinds import furniture_by_name
from .furniture_parts import AXIS, OPENS, FoundPart, read_parts, topmost
from .light_things import riding
from .points import HINGE, goal_point_of

_DEEP, _LARGEST = 0.2, 2.6  # metres that furniture is deep at least, and large at most
_LOW = 1.5  # metres: what is less high than that is no door to walk through
HALF = 0.5  # a front that is open by more is shut by the next goal
_WAY_OUT, _STEP, _ASIDE = 0.8, 0.01, 0.07  # metres before a thing, between looks, and beside it for a hand
_INSIDE = 0.6  # metres: what is larger stands in no drawer
_MEETS = 0.004  # metres from such a way at which a front is in it


def is_front(target: bpy.types.Object) -> bool:
    """Whether an object is a part of furniture that opens, rather than the leaf of a door to walk through."""
    scene = next(iter(target.users_scene), None)
    if scene is None or target.type != "MESH" or goal_point_of(scene, target, HINGE) is not None:
        return False
    if OPENS in target or goal_point_of(scene, target, AXIS) is not None:
        return True
    top = topmost(target)
    family = [o for o in family_of(top) if o.type == "MESH"]
    if top == target or len(family) < 2:
        return False
    low, high = _bounds(family)
    size = np.sort((high - low)[:2])
    furniture = size[0] > _DEEP and max(size[1], (high - low)[2]) < _LARGEST
    own = _bounds([target])
    return furniture and (furniture_by_name(target) is not None or float((own[1] - own[0])[2]) < _LOW)


def front_goal(name: str, target: bpy.types.Object, hold: float, around: Surroundings, here: Array) -> Goal:
    """Build the goal to open the front ``target``, or to shut it where it stands open by then, coming from
    ``here`` (2,).  GoalError where no hand can, GeometryError where it does not look as if it opened.
    """
    scene, earlier = around.scene, around.left.get(target)
    if earlier is not None and not isinstance(earlier[0], Front):
        raise GoalError(f"{target.name} is carried earlier in the take; choose another object to open.")
    if earlier is None:
        front = read_front(target, scene, around.frame)
        now = front
    else:
        front, now = earlier[0], replace(earlier[0], pose=earlier[1])
    middle = front.to_world(front.volume.centre)
    goal = Goal("open", name, np.append(middle[:2], 0.0), front.pose[3], hold, prop=front)
    goal.opening = 0.0 if now.opening > HALF else 1.0
    inside = standing_in(target)
    solids = but_moved(around, front.name, *(one.name for one in inside))
    here = np.asarray(here, dtype=np.float64)[:2]
    plan = around.plan(middle[:2], here)
    pulling = planned(goal, now, solids, plan, here)
    plan.require_way(here, pulling.reach.place)
    end, around.inside[target] = front.pose_at(pulling.end), inside
    for one in (target, *along_with(target)):
        known = around.left.get(one)
        if known is None or isinstance(known[0], Front):  # and has not been taken out
            around.left[one] = front, end
    return goal


def but_moved(around: Surroundings, *but: str, standing: DistanceQuery | None = None) -> DistanceQuery:
    """What stands (``standing``, all that no goal moves without it), and the props of earlier goals where
    these leave them, with what stands in drawers that they have opened, ``but`` those of some names.
    """
    moved: dict[str, Prop] = {thing.name: thing for _, _, thing in riding(around) if thing.name not in but}
    for prop, pose in around.left.values():
        if prop.name not in but:
            moved[prop.name] = replace(prop, pose=pose)
    standing = around.query if standing is None else standing
    return Union([standing, *moved.values()]) if moved else standing


def read_front(target: bpy.types.Object, scene: bpy.types.Scene, frame: WorldFrame) -> Front:
    """A part of furniture as a prop, as far open as it is; raises as ``front_goal``."""
    try:
        found = read_parts(scene, [topmost(target)], frame)
    except GeometryError as error:
        raise GoalError(f"{target.name} cannot be opened. {error}") from error
    for each in found:
        if each.front == target or target.name in each.names:
            return Front.of(each.part, each.front.name)
    raise GoalError(
        f"{target.name} is not found to open; choose the object of a door or a drawer alone, parented to its "
        "furniture, or name it so."
    )


def along_with(target: bpy.types.Object) -> list[bpy.types.Object]:
    """Objects that go along with a front without hanging on it: its handle and panes, and what stands in a
    drawer; the topmost of those parented to each other.
    """
    found = _part_of(target)
    if found is None:
        return []
    own = {target, *target.children_recursive}
    objects = target.users_scene[0].objects
    return [
        *(o for name in found[0].names if (o := objects[name]) not in own),
        *_standing_in(target, found[1]),
    ]


def standing_in(target: bpy.types.Object) -> list[bpy.types.Object]:
    """Of these what stands in a drawer."""
    found = _part_of(target)
    return [] if found is None else _standing_in(target, found[1])


def _part_of(target: bpy.types.Object) -> tuple[FoundPart, Front] | None:
    """The part of furniture that an object is; None, which is told when its goal is looked for."""
    try:
        parts = read_parts(target.users_scene[0], [topmost(target)], WorldFrame())
        each = next(e for e in parts if target.name in e.names)
        return each, Front.of(each.part)
    except (GeometryError, GoalError, StopIteration):
        return None


def _standing_in(target: bpy.types.Object, front: Front) -> list[bpy.types.Object]:
    found, top = [], topmost(target)
    for other in target.users_scene[0].objects:
        if other.type != "MESH" or other.parent is not None or other == top:
            continue
        low, high = _bounds([other])
        foot = np.array((*((low + high) / 2)[:2], low[2], 0.0))
        if (high - low).max() < _INSIDE and front.carries(foot):
            found.append(other)
    return found


def shut_away(target: bpy.types.Object) -> list[bpy.types.Object]:
    """The fronts of furniture that must open before a hand gets at an object: the drawer it stands in, else
    what is before it, and a door beside it within a hand's breadth.
    """
    scene = next(iter(target.users_scene), None)
    if scene is None:
        return []
    low, high = _bounds([o for o in family_of(target) if o.type == "MESH"] or [target])
    middle = (low + high) / 2
    found: list[bpy.types.Object] = []
    for top in _furniture_about(scene, target, middle):
        try:
            parts = read_parts(scene, [top], WorldFrame())
        except GeometryError:
            continue
        found += _before(parts, middle, low[2])
    return found


def _before(parts: Iterable[FoundPart], middle: Array, foot: float) -> list[bpy.types.Object]:
    found = []
    for each in parts:
        part = each.part
        try:
            front = Front.of(part, each.front.name)
        except GoalError:
            continue
        if front.opening > HALF:
            continue
        if part.kind == "drawer":
            if front.carries(np.array((middle[0], middle[1], foot, 0.0))):
                return [each.front]
            continue
        steps = np.arange(0.0, _WAY_OUT, _STEP)[:, None]
        for aside in (0.0, -_ASIDE, _ASIDE) if part.turns else (0.0,):
            way = front.to_local(middle) + (aside, 0.0, 0.0) + steps * part.away
            if (front.query.signed_distance(way.astype(np.float32), 0.1) < _MEETS).any():
                found.append(each.front)
                break
    return found


def _furniture_about(
    scene: bpy.types.Scene, target: bpy.types.Object, middle: Array
) -> list[bpy.types.Object]:
    """What consists of parts and has a place (3,) within the box around it."""
    tops = {topmost(o) for o in scene.objects if o.type == "MESH" and o.parent is not None}
    found = []
    for top in sorted(tops - {topmost(target)}, key=lambda o: o.name):
        family = [o for o in family_of(top) if o.type == "MESH" and not o.hide_get()]
        if len(family) < 2:
            continue
        low, high = _bounds(family)
        if (middle > low).all() and (middle < high).all() and (high - low).max() < 2 * _LARGEST:
            found.append(top)
    return found


def _bounds(objects: Iterable[bpy.types.Object]) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) of objects' own boxes, world."""
    corners = np.array([o.matrix_world @ Vector(c) for o in objects for c in o.bound_box])
    return corners.min(0), corners.max(0)
