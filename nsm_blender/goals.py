"""From a Blender object and an action to a goal that the core understands."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.props import Box, Leaf, passage
from nsm_core.control.standing import further_off, standing_place
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, direction_to_heading
from nsm_core.seats import find_seat
from nsm_core.skeleton import HIP_OVER_SEAT

from .actions import require_action
from .bodies import Body, place_of
from .carrying import carry_goal
from .climbing import climb_goal
from .doors import open_goal
from .points import HANDLE, HINGE, POINT_ACTION, POINT_LINK, POINT_NAME, POINT_TO, SWING, goal_point_of, make_point
from .scene import WorldFrame
from .surroundings import Surroundings

__all__ = ["POINT_ACTION", "POINT_LINK", "GoalSpec", "goal_point_of", "moved_by", "place_after", "resolve", "show_goal_point"]

# Seats that a person of the skeleton's size can use, metres over the floor.
LOWEST_SEAT, HIGHEST_SEAT = 0.25, 0.8
# Where one stands before an object that one walks up to, metres from its front.
_STAND_OFF = 0.45


@dataclass
class GoalSpec:
    """A goal as asked for: an object or a place (3,), world, an action and a hold in seconds; ``to`` where a box is carried."""

    action: str
    object: bpy.types.Object | None = None
    hold: float = 2.0
    location: tuple[float, float, float] | None = None
    to: bpy.types.Object | None = None

    @property
    def label(self) -> str:
        """Name of the goal in lists, reports and messages."""
        return self.object.name if self.object else "place" if self.location is not None else "here"


def moved_by(specs: list[GoalSpec]) -> list[bpy.types.Object]:
    """The objects that goals move, each once: boxes that are carried and leaves that are opened."""
    return list(dict.fromkeys(s.object for s in specs if s.object is not None and require_action(s.action).moves))


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
        if needed is not None and needed.name not in scene.objects:
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


def place_after(goal: Goal, before: tuple[Array, float], around: Surroundings) -> tuple[Array, float]:
    """Ground point (2,) and heading where a goal, resolved last in ``around``, leaves the character that came from ``before``."""
    if isinstance(goal.prop, Leaf):
        way = passage(goal.prop, np.asarray(before[0], dtype=np.float64))
        return way.beyond.astype(np.float32), way.heading
    if isinstance(goal.prop, Box):
        facing = goal.heading - around.left[goal.name][1][3]
        further = further_off(goal.prop, facing, goal.position, goal.heading, around.query)
        return standing_place(goal.prop, facing, goal.position, goal.heading, further).astype(np.float32), goal.heading
    return goal.position[:2], goal.heading


def _sit(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings) -> Goal:
    frame, body = around.frame, around.body(spec.object)
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
    if not LOWEST_SEAT <= seat_point[2] <= HIGHEST_SEAT:
        raise GoalError(
            f"The seat of {spec.object.name} is {seat_point[2] * frame.scale:.2f} m over the character's floor; people sit between "
            f"{LOWEST_SEAT * frame.scale:.2f} and {HIGHEST_SEAT * frame.scale:.2f} m: move the goal point or the object."
        )
    hips = seat_point + np.array((0, 0, HIP_OVER_SEAT), np.float32)
    return Goal("sit", spec.label, hips.astype(np.float32), heading, spec.hold, body.interaction(along))


def _walk(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: tuple[Array, float]) -> Goal:
    frame, (here, facing) = around.frame, before
    if spec.object is not None:
        point = goal_point_of(scene, spec.object, spec.action)
        if point is not None or spec.object.type == "EMPTY":
            position, heading = place_of(point or spec.object, frame)
        else:
            position, heading = _in_front_of(around.body(spec.object))
    else:
        position = frame.to_core(np.array(spec.location, dtype=np.float64))
        way = position[:2] - here
        heading = float(direction_to_heading(way)) if np.linalg.norm(way) > 0.2 else facing
    ground = np.array((position[0], position[1], 0.0), np.float32)
    return Goal(spec.action, spec.label, ground, float(heading), spec.hold)


def _in_front_of(body: Body) -> tuple[Array, float]:
    """Ground point (3,) before the object's front (its -Y) and the heading that looks at it, core frame."""
    front = body.vertices[:, 1].min() - _STAND_OFF
    return body.to_core(np.array((0.0, front, 0.0))), float(body.yaw + np.pi)


def show_goal_point(
    spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: tuple[Array, float], around: Surroundings | None = None
) -> bpy.types.Object:
    """Return the editable goal point of a goal's object, made from the mesh on the first call.

    It marks the middle of the hips' place on the seat, the place where a box is set down or one stands, or the ground
    point, and looks along its -Y.  A door has two: its hinge, which is returned, and its handle.  They are children of the
    object (a box's of the destination) and go where it goes.  Raises as ``resolve`` does.
    """
    goal = resolve(spec, scene, frame, before, around)
    if isinstance(goal.prop, Leaf):
        return _show_door_points(spec.object, goal.prop, scene, frame)
    carry = isinstance(goal.prop, Box)
    existing = goal_point_of(scene, spec.object, spec.action, spec.to if carry else None)
    if existing is not None or carry and spec.to.type == "EMPTY":
        return existing or spec.to
    position = np.array(goal.position, dtype=np.float64)
    if spec.action == "sit":
        position[2] -= HIP_OVER_SEAT
    if carry:
        position[2] -= goal.prop.size[2] / 2
    point = make_point(
        f"{POINT_NAME} {spec.object.name}", spec.object, spec.action, position, goal.heading, frame, spec.to if carry else spec.object
    )
    if carry:
        point[POINT_TO] = spec.to
    bpy.context.view_layer.update()
    return point


def _show_door_points(target: bpy.types.Object, leaf: Leaf, scene: bpy.types.Scene, frame: WorldFrame) -> bpy.types.Object:
    hinge = goal_point_of(scene, target, HINGE)
    if hinge is None:
        hinge = make_point(f"NSM Hinge {target.name}", target, HINGE, leaf.pose[:3], float(leaf.pose[3]), frame, target)
        hinge[SWING] = int(leaf.swing)
        hinge.id_properties_ui(SWING).update(
            min=-1, max=1, description="1: seen from above, the leaf turns counter-clockwise as it opens; -1: clockwise"
        )
    if goal_point_of(scene, target, HANDLE) is None:
        make_point(f"NSM Handle {target.name}", target, HANDLE, leaf.to_world(leaf.handle), float(leaf.pose[3]), frame, target)
    bpy.context.view_layer.update()
    return hinge
