"""What opens of furniture in a scene, read from its meshes, and from the points that the animator has put on
its axes and handles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.opening_parts import opening_parts
from nsm_core.world.scene.containers import MovingPart
from nsm_core.world.scene.props import sense

from ..world.bvh_query import BVHQuery
from ..world.evaluated import Snapshot, family_of, join
from ..world.frame import WorldFrame
from .points import goal_point_of

OPENS = "nsm_opens"  # of what shows an axis: how far a part goes about or along its Z, radians or metres
SHUT = "nsm_shut"  # of a point on an axis: where its front is when it is shut, in the furniture's frame
AXIS, GRIP = "axis", "grip"  # actions of the two points


@dataclass(frozen=True)
class FoundPart:
    """A ``part`` of furniture, its pose where the furniture stands, core frame, as far open as it is now; the
    object of its ``front``, and the ``names`` of all that it consists of.
    """

    part: MovingPart
    front: bpy.types.Object
    names: list[str]


def topmost(target: bpy.types.Object) -> bpy.types.Object:
    """The object on which one hangs in the end."""
    while target.parent is not None:
        target = target.parent
    return target


def meshes_of(tops: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """The meshes of a piece of furniture that are shown."""
    return [o for top in tops for o in family_of(top) if o.type == "MESH" and not o.hide_get()]


def read_parts(
    scene: bpy.types.Scene, tops: Sequence[bpy.types.Object], frame: WorldFrame
) -> list[FoundPart]:
    """What opens of a piece of furniture that consists of what hangs on ``tops``, the first of which says
    where its front is: its -Y.  GeometryError where nothing of it looks as if it opened.
    """
    top, meshes = tops[0], meshes_of(tops)
    place = frame.to_core(np.array(top.matrix_world.translation)).astype(np.float64)
    heading, noted = heading_of(top), {o: _shut(scene, top, o) for o in meshes}
    back = {o: shut @ o.matrix_world.inverted_safe() for o, shut in noted.items() if shut is not None}
    snapshot, parts = Snapshot.of_objects(meshes), []
    for each in meshes:
        holder = next((o for o in _chain(each) if o in back), None)
        shapes = [
            _Shape(s.mesh.faces, np.array(back.get(holder, Matrix())) @ np.asarray(s.matrix), frame)
            for s in snapshot.of([each.name_full])
            if not s.mesh.empty
        ]
        if shapes:
            vertices, triangles = join(shapes)
            parts.append((each.name, rotate_planar(vertices - place, np.float64(-heading)), triangles))
    found, shapes_of = [], {name: _Joined(v, f) for name, v, f in parts}
    for proposal in opening_parts(parts):
        front, part = scene.objects[proposal.names[0]], proposal.part
        vertices, triangles = join([shapes_of[name] for name in proposal.names])
        part.query = BVHQuery.from_triangles(vertices.astype(np.float32), triangles)
        part.volume = sense(part.query, vertices.min(0), vertices.max(0))
        part.pose = np.append(place, heading)
        _as_shown(scene, front, part, frame)
        if front in back:
            part.opening = _opening(part, Matrix(noted[front]).inverted_safe(), front.matrix_world, frame)
        found.append(FoundPart(part, front, proposal.names))
    return found


def heading_of(target: bpy.types.Object) -> float:
    """The turn about the vertical of an object's X, 0 where that is upright."""
    x = target.matrix_world.col[0]
    return float(np.arctan2(x[1], x[0])) if np.hypot(x[0], x[1]) > 1e-6 else 0.0


def _chain(target: bpy.types.Object) -> list[bpy.types.Object]:
    chain = [target]
    while chain[-1].parent is not None:
        chain.append(chain[-1].parent)
    return chain


def _shut(scene: bpy.types.Scene, top: bpy.types.Object, front: bpy.types.Object) -> Matrix | None:
    """Where a front is in the world when it is shut, where the point on its axis tells."""
    point = goal_point_of(scene, front, AXIS)
    if point is None or SHUT not in point:
        return None
    return top.matrix_world @ Matrix(np.array(point[SHUT], dtype=np.float64).reshape(4, 4).tolist())


def _as_shown(scene: bpy.types.Scene, front: bpy.types.Object, part: MovingPart, frame: WorldFrame) -> None:
    """Let a part turn or slide as the points on its axis and at its handle show it, or its own axes where it
    tells by ``OPENS`` that it goes about or along its Z.
    """

    def own(points: Array) -> Array:
        return rotate_planar(frame.to_core(points) - part.pose[:3], np.float64(-part.pose[3]))

    axis, grip = goal_point_of(scene, front, AXIS), goal_point_of(scene, front, GRIP)
    shown = axis if axis is not None else front
    if OPENS in shown:
        z = np.array(shown.matrix_world.to_3x3().col[2])
        part.axis = rotate_planar(z / np.linalg.norm(z), np.float64(-part.pose[3]))
        part.pivot = own(np.array(shown.matrix_world.translation))
        part.travel = max(float(shown[OPENS]), 1e-3)
        part.travel /= 1.0 if part.turns else frame.scale
    if grip is not None:
        part.handle = own(np.array(grip.matrix_world.translation))


def _opening(part: MovingPart, back: Matrix, now: Matrix, frame: WorldFrame) -> float:
    """How far a part is open that has been moved from where it is shut."""
    move = now @ back
    axis = rotate_planar(part.axis, np.float64(part.pose[3]))
    if part.turns:
        turn = move.to_quaternion()
        angle = 2 * np.arctan2(float(np.array(turn)[1:] @ axis), turn.w)
        return float(np.clip((angle + np.pi) % (2 * np.pi) - np.pi, 0, part.travel) / part.travel)
    shift = (np.array(now.translation) - np.array(back.inverted_safe().translation)) / frame.scale
    return float(np.clip(shift @ axis / part.travel, 0.0, 1.0))


@dataclass(frozen=True)
class _Joined:
    """A mesh in the frame of its furniture."""

    vertices: Array
    triangles: Array


class _Shape:
    """A mesh where it is shown, core frame."""

    def __init__(self, faces: tuple[Array, Array], matrix: Array, frame: WorldFrame) -> None:
        place = np.asarray(matrix, dtype=np.float64)
        self.vertices = frame.to_core(faces[0].astype(np.float64) @ place[:3, :3].T + place[:3, 3])
        self.triangles = faces[1]
