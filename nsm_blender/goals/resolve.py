"""From a Blender object and an action to a goal that the core understands."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from nsm_core.body.skeleton import HIP_OVER_SEAT
from nsm_core.control.goals import Goal
from nsm_core.distances import STAND_AHEAD
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, direction_to_heading, heading_to_direction, rotate_planar
from nsm_core.world.affordances.passage import passage
from nsm_core.world.affordances.seat import find_seat
from nsm_core.world.affordances.standing import further_off, standing_place
from nsm_core.world.scene.props import Box, Leaf

from ..world.bodies import GoalBody, place_of
from ..world.frame import WorldFrame, holds
from ..world.surroundings import Surroundings
from .carry import carry_goal
from .climb import climb_goal
from .door_handles import HANDLE_HEIGHT, fittings_of
from .door_kinds import require_swings
from .loose_parts import is_group, seat_body
from .open import open_goal
from .points import HANDLE, HINGE, POINT_ACTION, POINT_LINK, POINT_NAME, POINT_TO, SWING, goal_point_of, make_point
from .spec import GoalSpec
from .table import require_action
from .walk import crossings, require_support, walk_goal, what_stands_at

__all__ = ["POINT_ACTION", "POINT_LINK", "goal_point_of", "moved_by", "place_after", "resolve", "show_goal_point"]

# Seats that a person of the skeleton's size can use, metres over the floor.
LOWEST_SEAT, HIGHEST_SEAT = 0.25, 0.8
# Where one stands before an object that one walks up to, metres from its front.
_STAND_OFF = 0.45


def moved_by(specs: list[GoalSpec]) -> list[bpy.types.Object]:
    """The objects that goals move, each once: boxes that are carried, and leaves that are opened with what hangs on them."""
    moved = [s for s in specs if s.object is not None and require_action(s.action).moves]
    parts = [part for s in moved for part in (s.object, *(fittings_of(s.object) if s.action == "open" else ()))]
    return list(dict.fromkeys(parts))


def resolve(
    spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: tuple[Array, float], around: Surroundings | None = None
) -> Goal:
    """Build the core's goal: all positions in the core's frame of the character (``frame``).

    ``before`` is the ground point (2,) and heading from which the character will come, core frame; ``around`` the scene with
    what earlier goals have moved (read anew without it).
    Raises GoalError where the object is missing or out of reach, GeometryError where its mesh is of no use.
    """
    action = require_action(spec.action)
    if spec.object is None and (action.needs_object or spec.action != "idle" and spec.location is None):
        raise GoalError(f"A goal to {spec.action} has no object; choose one, or remove the goal.")
    if action.needs_destination and spec.to is None:
        raise GoalError(f"A goal to {spec.action} {spec.label} has no destination; choose the object or empty where it goes.")
    for kind, needed in (("goal object", spec.object), ("destination", spec.to if action.needs_destination else None)):
        if needed is not None and not holds(scene, needed):
            raise GoalError(f"The {kind} {needed.name} is no longer in the scene; choose another object, or remove the goal.")
    around = around or Surroundings(scene, frame, moving=moved_by([spec]))
    name, here = spec.label, before[0]
    if spec.action == "idle":
        return Goal("idle", "here", np.append(here, 0.0), before[1], spec.hold)
    if spec.action == "sit":
        return _sit(spec, scene, around)
    if spec.action == "carry":
        point = goal_point_of(scene, spec.object, "carry", spec.to)
        return carry_goal(name, spec.object, spec.to, point, spec.hold, around, here)
    if spec.action == "open":
        hinge, handle = (goal_point_of(scene, spec.object, part) for part in (HINGE, HANDLE))
        return open_goal(name, spec.object, hinge, handle, spec.hold, around, here)
    if spec.action == "climb":
        return climb_goal(name, spec.object, goal_point_of(scene, spec.object, "climb"), spec.hold, around, here)
    return _walk(spec, scene, around, before)


def require_swinging(goals: Sequence[GoalSpec], scene: bpy.types.Scene) -> None:
    """Raise GoalError where one is to open what moves in another way than a leaf swings, unless the animator gave it a hinge."""
    for spec in goals:
        if spec.action == "open" and spec.object is not None and goal_point_of(scene, spec.object, HINGE) is None:
            require_swings(spec.object)


def place_after(goal: Goal, before: tuple[Array, float], around: Surroundings) -> tuple[Array, float]:
    """Ground point (2,) and heading where a goal, resolved last in ``around``, leaves the character that came from ``before``."""
    if isinstance(goal.prop, Leaf):
        way = passage(goal.prop, np.asarray(before[0], dtype=np.float64))
        return way.beyond.astype(np.float32), way.heading
    if isinstance(goal.prop, Box):
        pose = next(left for prop, left in around.left.values() if prop is goal.prop)
        facing = goal.heading - pose[3]
        further = further_off(goal.prop, facing, goal.position, goal.heading, around.query)
        return standing_place(goal.prop, facing, goal.position, goal.heading, further).astype(np.float32), goal.heading
    return goal.position[:2], goal.heading


def _sit(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings) -> Goal:
    frame = around.frame
    body = seat_body(spec.object, around)
    point = goal_point_of(scene, spec.object, "sit")
    if point is not None:
        seat_point, heading = place_of(point, frame)
        try:
            along = body.to_core_heading(find_seat(body.vertices, body.triangles).heading)
        except GeometryError:
            along = heading  # the animator knows of a seat where the mesh shows none
    else:
        seat_point, heading = body.seat_in_core()
        along = heading
    before = seat_point[:2] + STAND_AHEAD * heading_to_direction(np.array(heading))
    ground = float(around.ground.height(before[None])[0])
    if not LOWEST_SEAT <= seat_point[2] - ground <= HIGHEST_SEAT:
        raise GoalError(
            f"The seat of {spec.object.name} is {(seat_point[2] - ground) * frame.scale:.2f} m over the character's floor; people sit "
            f"between {LOWEST_SEAT * frame.scale:.2f} and {HIGHEST_SEAT * frame.scale:.2f} m: move the goal point or the object."
        )
    if point is not None:
        require_support(spec.object.name, seat_point, around)
    hips = seat_point + np.array((0, 0, HIP_OVER_SEAT), np.float32)
    return Goal("sit", spec.label, hips.astype(np.float32), heading, spec.hold, body.interaction(along))


def _walk(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: tuple[Array, float]) -> Goal:
    here, facing = before
    frame, name = around.frame, spec.label
    if spec.object is not None:
        point = goal_point_of(scene, spec.object, spec.action)
        if point is not None or spec.object.type == "EMPTY" and not is_group(spec.object):
            name = (point or spec.object).name
            position, heading = place_of(point or spec.object, frame)
        else:
            position, heading = _in_front_of(seat_body(spec.object, around), around)
    else:
        position = frame.to_core(np.array(spec.location, dtype=np.float64))
        way = position[:2] - here
        heading = float(direction_to_heading(way)) if np.linalg.norm(way) > 0.2 else facing
    goal = walk_goal(spec.action, name, position, heading, spec.hold, around, here)
    goal.name = spec.label
    return goal


def _in_front_of(body: GoalBody, around: Surroundings) -> tuple[Array, float]:
    """Ground point (3,) before the object's front (its -Y) and the heading that looks at it, core frame.

    Where something stands there, it is the next side that is free: left, right, and last behind.
    """
    (low, high), best = body.bounds, None
    for turn, away in ((0.0, -low[1]), (np.pi / 2, high[0]), (-np.pi / 2, -low[0]), (np.pi, high[1])):
        place = rotate_planar(np.array((0.0, -away - _STAND_OFF, 0.0)), np.float64(turn))
        found = body.to_core(place), float(body.yaw + turn + np.pi)
        best = best or found
        ground = float(around.ground.height(found[0][None, :2])[0])
        if what_stands_at(found[0][:2].astype(np.float64), ground, around) is None:
            return found[0] + np.array((0, 0, ground), np.float32), found[1]
    return best


def show_goal_point(
    spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: tuple[Array, float],
    around: Surroundings | None = None, told: list[str] | None = None,
) -> bpy.types.Object:  # fmt: skip
    """Return the editable goal point of a goal's object, made from the mesh on the first call.

    It marks the middle of the hips' place on the seat, the place where a box is set down or one stands, or the ground
    point, and looks along its -Y.  A door has two: its hinge, which is returned, and its handle.  They are children of the
    object (a box's of the destination) and go where it goes.  Where no place is found, one is made all the same, to be moved,
    and ``told`` hears why in a sentence; so it is of a place that is of no use.  Raises as ``resolve`` does where there is
    nothing that could have a point.
    """
    around = around or Surroundings(scene, frame, moving=moved_by([spec]))
    goal, reason = None, ""
    try:
        goal = resolve(spec, scene, frame, before, around)
    except (GoalError, GeometryError) as error:
        if spec.object is None or not all(o is None or holds(scene, o) for o in (spec.object, spec.to)):
            raise
        reason = str(error)
    carry = spec.action == "carry"
    if spec.action == "open":
        leaf = goal.prop if goal is not None else None
        return _show_door_points(spec.object, leaf, around.body(spec.object, snug=True), reason, scene, frame, told)
    existing = goal_point_of(scene, spec.object, spec.action, spec.to if carry else None)
    if existing is not None or carry and spec.to is not None and spec.to.type == "EMPTY":
        if reason and told is not None:
            told.append(reason)
        return existing or spec.to
    holder = spec.to if carry else spec.object
    if holder is None:
        raise GoalError(reason)
    if goal is None:
        position, heading = _somewhere_on(around.body(holder), spec.action)
    else:
        position, heading = np.array(goal.position, dtype=np.float64), goal.heading
        position[2] -= HIP_OVER_SEAT if spec.action == "sit" else goal.prop.size[2] / 2 if carry else 0.0
    point = make_point(f"{POINT_NAME} {spec.object.name}", spec.object, spec.action, position, heading, frame, holder)
    if carry:
        point[POINT_TO] = spec.to
    if goal is None and told is not None:
        told.append(f"{reason} {point.name} was put on {holder.name} all the same: move it to where it should be.")
    bpy.context.view_layer.update()
    return point


def _somewhere_on(body: GoalBody, action: str) -> tuple[Array, float]:
    """A place (3,) to begin with where the mesh shows none, and its heading, core frame: on its middle, or before it."""
    (low, high), heading = body.bounds, body.yaw
    if action in ("walk", "run"):
        return body.to_core(np.array((0.0, low[1] - _STAND_OFF, 0.0))), float(heading + np.pi)
    heights = np.append(crossings(body.vertices, body.triangles, np.zeros(2)), high[2])
    fitting = heights[(heights >= LOWEST_SEAT) & (heights <= HIGHEST_SEAT)] if action == "sit" else heights
    return body.to_core(np.array((0.0, 0.0, float(fitting.max() if len(fitting) else high[2])))), float(heading)


def _show_door_points(
    target: bpy.types.Object,
    leaf: Leaf | None,
    body: GoalBody,
    reason: str,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    told: list[str] | None,
) -> bpy.types.Object:
    """The points of a ``leaf``, or of what was found to be none for some ``reason``: at its edges."""
    (low, high), heading = body.bounds, body.yaw
    hinge, handle = goal_point_of(scene, target, HINGE), goal_point_of(scene, target, HANDLE)
    if leaf is not None:
        pin, grip, heading = leaf.pose[:3], leaf.to_world(leaf.handle), float(leaf.pose[3])
    else:
        pin, grip = body.to_core(np.array(((low[0], 0.0, 0.0), (0.9 * high[0], 0.0, HANDLE_HEIGHT))))
    if reason and told is not None:
        told.append(reason if hinge and handle else f"{reason} Points of its hinge and handle were put on it all the same: move them.")
    if hinge is None:
        hinge = make_point(f"NSM Hinge {target.name}", target, HINGE, pin, heading, frame, target)
        hinge[SWING] = int(leaf.swing) if leaf is not None else 1
        hinge.id_properties_ui(SWING).update(
            min=-1, max=1, description="1: seen from above, the leaf turns counter-clockwise as it opens; -1: clockwise"
        )
    if handle is None:
        make_point(f"NSM Handle {target.name}", target, HANDLE, grip, heading, frame, target)
    bpy.context.view_layer.update()
    return hinge
