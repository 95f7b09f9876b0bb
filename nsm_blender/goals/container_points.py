"""What opens of a piece of furniture, proposed as empties to edit: one on the axis, one at the handle.

The Z of the axis' empty is the axis; how far the part goes about or along it, radians or metres, stands in
its property ``nsm_opens``, and
where its front was when it was proposed, shut, in ``nsm_shut``.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.scene.containers import MovingPart

from ..world.frame import WorldFrame
from .furniture_parts import AXIS, GRIP, OPENS, SHUT, FoundPart, heading_of, meshes_of, read_parts, topmost
from .points import POINT_ACTION, POINT_LINK, goal_point_of

_AXIS_SIZE, _GRIP_SIZE = 0.2, 0.03  # of the empties, Blender units


def show_what_opens(
    scene: bpy.types.Scene, chosen: list[bpy.types.Object]
) -> tuple[list[bpy.types.Object], list[FoundPart]]:
    """Propose what opens of the furniture that ``chosen`` objects are part of.

    Returns the empties added, as children of the furniture, and all proposals, in the frame of its topmost
    object: upright, its -Y the front.  A part that has its points keeps them as they are.  Raises GoalError
    where nothing with a mesh is chosen, GeometryError where nothing looks as if it opened.
    """
    tops = list(dict.fromkeys(topmost(o) for o in chosen))
    if not meshes_of(tops):
        raise GoalError("Nothing with a mesh is selected; select a piece of furniture with all its parts.")
    found, added = read_parts(scene, tops, WorldFrame()), []
    place, heading = np.array(tops[0].matrix_world.translation), heading_of(tops[0])
    frame = Matrix.Translation(place.tolist()) @ Matrix.Rotation(heading, 4, "Z")
    for each in found:
        part, front = each.part, each.front
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
                shut = tops[0].matrix_world.inverted_safe() @ front.matrix_world
                point[SHUT] = [value for row in shut for value in row]
            added.append(point)
    return added, found


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


def _point(name: str, parent: bpy.types.Object, place: Matrix, size: float, look: str) -> bpy.types.Object:
    point = bpy.data.objects.new(name, None)
    point.empty_display_type, point.empty_display_size = look, size
    point.show_in_front = True
    (parent.users_collection or (bpy.context.scene.collection,))[0].objects.link(point)
    point.parent = parent
    point.matrix_parent_inverse = parent.matrix_world.inverted_safe()
    point.matrix_basis = place
    return point
