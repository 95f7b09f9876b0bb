"""What opens of a piece of furniture, proposed as empties to edit: one on the axis, one at the handle.

The Z of the axis' empty is the axis; how far the part goes about or along it, radians or metres, stands in
its property ``nsm_opens``.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.errors import GoalError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.opening_parts import OpeningProposal, opening_parts
from nsm_core.world.scene.containers import MovingPart

from ..world.evaluated import Snapshot, family_of, join
from .points import POINT_ACTION, POINT_LINK, goal_point_of

OPENS = "nsm_opens"
AXIS, GRIP = "axis", "grip"  # actions of the two points
_AXIS_SIZE, _GRIP_SIZE = 0.2, 0.03  # of the empties, Blender units


def show_what_opens(
    scene: bpy.types.Scene, chosen: list[bpy.types.Object]
) -> tuple[list[bpy.types.Object], list[OpeningProposal]]:
    """Propose what opens of the furniture that ``chosen`` objects are part of.

    Returns the empties added, as children of the furniture, and all proposals, in the frame of its topmost
    object: upright, its -Y the front.  A part that has its points keeps them as they are.  Raises GoalError
    where nothing with a mesh is chosen, GeometryError where nothing looks as if it opened.
    """
    tops = list(dict.fromkeys(_topmost(o) for o in chosen))
    meshes = [o for top in tops for o in family_of(top) if o.type == "MESH" and not o.hide_get()]
    if not meshes:
        raise GoalError("Nothing with a mesh is selected; select a piece of furniture with all its parts.")
    place, heading = np.array(tops[0].matrix_world.translation), _heading(tops[0])
    snapshot, parts = Snapshot.of_objects(meshes), []
    for each in meshes:
        shapes = [_Shape(s.mesh.faces, s.matrix) for s in snapshot.of([each.name_full]) if not s.mesh.empty]
        if shapes:
            vertices, triangles = join(shapes)
            parts.append((each.name, rotate_planar(vertices - place, np.float64(-heading)), triangles))
    proposals, added = opening_parts(parts), []
    frame = Matrix.Translation(place.tolist()) @ Matrix.Rotation(heading, 4, "Z")
    for proposal in proposals:
        part, front = proposal.part, scene.objects[proposal.names[0]]
        handle = np.eye(4)
        handle[:3, 3] = part.handle
        for action, own, size, look in (
            (AXIS, axis_frame(part), _AXIS_SIZE, "ARROWS"),
            (GRIP, handle, _GRIP_SIZE, "SPHERE"),
        ):
            if goal_point_of(scene, front, action) is not None:
                continue
            point = _point(f"{front.name} {action}", tops[0], frame @ Matrix(own.tolist()), size, look)
            point[POINT_LINK], point[POINT_ACTION] = front, action
            if action == AXIS:
                point[OPENS] = float(part.travel)
            added.append(point)
    return added, proposals


def axis_frame(part: MovingPart) -> Array:
    """The frame (4, 4) on a part's axis, in its furniture's: Z along the axis, X level where that can be."""
    z = part.axis
    x = np.array((1.0, 0.0, 0.0)) if abs(z[0]) < 0.9 else np.array((0.0, 1.0, 0.0))
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.stack((x, np.cross(z, x), z), -1)
    frame[:3, 3] = part.pivot
    return frame


class _Shape:
    """A mesh where it is shown, world."""

    def __init__(self, faces: tuple[Array, Array], matrix: Array) -> None:
        place = np.asarray(matrix, dtype=np.float64)
        self.vertices = faces[0].astype(np.float64) @ place[:3, :3].T + place[:3, 3]
        self.triangles = faces[1]


def _topmost(target: bpy.types.Object) -> bpy.types.Object:
    while target.parent is not None:
        target = target.parent
    return target


def _heading(target: bpy.types.Object) -> float:
    """The turn about the vertical of an object's X, 0 where that is upright."""
    x = target.matrix_world.col[0]
    return float(np.arctan2(x[1], x[0])) if np.hypot(x[0], x[1]) > 1e-6 else 0.0


def _point(name: str, parent: bpy.types.Object, place: Matrix, size: float, look: str) -> bpy.types.Object:
    point = bpy.data.objects.new(name, None)
    point.empty_display_type, point.empty_display_size = look, size
    point.show_in_front = True
    (parent.users_collection or (bpy.context.scene.collection,))[0].objects.link(point)
    point.parent = parent
    point.matrix_parent_inverse = parent.matrix_world.inverted_safe()
    point.matrix_basis = place
    return point
