"""From a Blender object and an action to a goal that the core understands."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, direction_to_heading, rotate_planar
from nsm_core.seats import Seat, find_seat
from nsm_core.sensors.cuboid import InteractionVolume, interaction_sensor
from nsm_core.skeleton import HIP_OVER_SEAT

from .actions import require_action
from .colliders import BVHQuery, object_mesh_triangles
from .scene import WorldFrame

POINT_NAME = "NSM Goal"
POINT_LINK = "nsm_goal_of"  # custom property of a goal point: the object it belongs to
POINT_ACTION = "nsm_action"
# Seats that a person of the skeleton's size can use, metres over the floor.
LOWEST_SEAT, HIGHEST_SEAT = 0.25, 0.8
# Where one stands before an object that one walks up to, metres from its front.
_STAND_OFF = 0.45


@dataclass
class GoalSpec:
    """A goal as asked for: an object or a place (3,), world, an action and a hold in seconds."""

    action: str
    object: bpy.types.Object | None = None
    hold: float = 2.0
    location: tuple[float, float, float] | None = None

    @property
    def label(self) -> str:
        """Name of the goal in lists, reports and messages."""
        return self.object.name if self.object else "place" if self.location is not None else "here"


def goal_point_of(scene: bpy.types.Scene, target: bpy.types.Object, action: str) -> bpy.types.Object | None:
    """Return the editable goal point of an object for an action, if the animator has one in the scene."""
    for candidate in scene.objects:
        if candidate.type == "EMPTY" and candidate.get(POINT_LINK) == target and candidate.get(POINT_ACTION) == action:
            return candidate
    return None


def resolve(spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: tuple[Array, float]) -> Goal:
    """Build the core's goal: all positions in the core's frame of the character (``frame``).

    ``before`` is the ground point (2,) and heading from which the character will come, core frame.
    Raises GoalError where the object is missing or out of reach, GeometryError where its mesh is of no use.
    """
    action = require_action(spec.action)
    if spec.object is None and (action.needs_object or spec.action == "walk" and spec.location is None):
        raise GoalError(f"A goal to {spec.action} has no object; choose one, or remove the goal.")
    if spec.object is not None and spec.object.name not in scene.objects:
        raise GoalError(f"The goal object {spec.object.name} is no longer in the scene; choose another object, or remove the goal.")
    if spec.action == "idle":
        return Goal("idle", "here", np.append(before[0], 0.0), before[1], spec.hold)
    return _sit(spec, scene, frame) if spec.action == "sit" else _walk(spec, scene, frame, before)


def _sit(spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame) -> Goal:
    body = Body.of(spec.object, frame)
    point = goal_point_of(scene, spec.object, "sit")
    if point is not None:
        seat_point, heading = _place_of(point, frame)
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


def _walk(spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: tuple[Array, float]) -> Goal:
    here, facing = before
    if spec.object is not None:
        point = goal_point_of(scene, spec.object, spec.action)
        if point is not None or spec.object.type == "EMPTY":
            position, heading = _place_of(point or spec.object, frame)
        else:
            position, heading = _in_front_of(Body.of(spec.object, frame))
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


def _place_of(marker: bpy.types.Object, frame: WorldFrame) -> tuple[Array, float]:
    """Position (3,) and heading of an empty, core frame; it looks along its -Y."""
    matrix = marker.matrix_world
    forward = matrix.to_3x3() @ Vector((0, -1, 0))
    if forward.to_2d().length < 1e-6:
        raise GoalError(f"{marker.name} points straight up or down; turn it so that its -Y axis shows where the character looks.")
    return frame.to_core(np.array(matrix.translation)).astype(np.float32), float(direction_to_heading(np.array(forward)))


@dataclass
class Body:
    """A goal object's evaluated mesh, upright: Z up, origin on the floor at the centre of its footprint.

    ``vertices`` (V, 3) and ``triangles`` (F, 3), turned by ``-yaw`` about Z, in units of the character's size.
    """

    name: str
    vertices: Array
    triangles: Array
    origin: Array  # (2,) core frame
    yaw: float

    @classmethod
    def of(cls, target: bpy.types.Object, frame: WorldFrame) -> Body:
        """Read an object's mesh as the scene shows it; GeometryError when there is none."""
        vertices, triangles = object_mesh_triangles(target, bpy.context.evaluated_depsgraph_get())
        y = target.matrix_world.to_3x3() @ Vector((0, -1, 0))
        # An object that lies on its back (imported with Y up, say) keeps the world's axes.
        yaw = float(direction_to_heading(np.array(y))) if y.to_2d().length > 0.5 * y.length else 0.0
        turned = rotate_planar(frame.to_core(vertices), -yaw)
        low, high = turned.min(0), turned.max(0)
        centre = np.array(((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.0))
        return cls(target.name, (turned - centre).astype(np.float32), triangles, rotate_planar(centre[:2], yaw), yaw)

    def to_core(self, points: Array) -> Array:
        """Points (..., 3) of the upright object frame in the core's frame."""
        return (rotate_planar(np.asarray(points, dtype=np.float64), self.yaw) + np.append(self.origin, 0.0)).astype(np.float32)

    def to_core_heading(self, heading: float) -> float:
        """Heading in the object frame as one in the core's frame, radians."""
        return float(heading + self.yaw)

    def seat_in_core(self) -> tuple[Array, float]:
        """Seat point (3,) and heading, core frame; GeometryError names the object when there is no seat."""
        try:
            seat: Seat = find_seat(self.vertices, self.triangles)
        except GeometryError as error:
            raise GeometryError(f"{self.name}: {error}") from error
        return self.to_core(seat.point), self.to_core_heading(seat.heading)

    def interaction(self, heading: float) -> InteractionVolume:
        """Read the interaction sensor over this object, its box turned to ``heading`` (core frame), as in training."""
        world = self.to_core(self.vertices)
        along = rotate_planar(world, -heading)
        low, high = along.min(0), along.max(0)
        query = BVHQuery.from_triangles(world, self.triangles)
        return interaction_sensor(query, rotate_planar((low + high) / 2, heading), high - low, heading)


def show_goal_point(spec: GoalSpec, scene: bpy.types.Scene, frame: WorldFrame, before: tuple[Array, float]) -> bpy.types.Object:
    """Return the editable goal point of a goal's object, made from the mesh on the first call.

    It marks the middle of the hips' place on the seat, or the ground point, and looks along its -Y.  It is a
    child of the object and goes where the object goes.  Raises as ``resolve`` does.
    """
    goal = resolve(spec, scene, frame, before)
    existing = goal_point_of(scene, spec.object, spec.action)
    if existing is not None:
        return existing
    position = np.array(goal.position, dtype=np.float64)
    if spec.action == "sit":
        position[2] -= HIP_OVER_SEAT
    point = bpy.data.objects.new(f"{POINT_NAME} {spec.object.name}", None)
    point.empty_display_type, point.empty_display_size = "ARROWS", 0.25 * frame.scale
    point.show_in_front, point.show_name = True, True
    point[POINT_LINK], point[POINT_ACTION] = spec.object, spec.action
    (spec.object.users_collection or (scene.collection,))[0].objects.link(point)
    place = Matrix.Translation(Vector(frame.to_world(position))) @ Matrix.Rotation(goal.heading, 4, "Z")
    point.parent = spec.object
    point.matrix_parent_inverse = spec.object.matrix_world.inverted_safe()
    point.matrix_basis = place
    bpy.context.view_layer.update()
    return point
