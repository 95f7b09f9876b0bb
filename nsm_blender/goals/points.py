"""Goal points: empties that show where a goal was found on its object, and let the animator move it."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Vector

from nsm_core.rotations import Array

from ..world.frame import WorldFrame

POINT_NAME = "NSM Goal"
POINT_LINK = "nsm_goal_of"  # custom property of a goal point: the object it belongs to
POINT_ACTION = "nsm_action"
POINT_TO = "nsm_to"  # of the place where a box is set down: the destination
# Of a hinge point: 1 where the leaf turns counter-clockwise as it opens, seen from above, -1 where clockwise.
SWING = "nsm_swing"
HINGE, HANDLE = "hinge", "handle"


def goal_point_of(
    scene: bpy.types.Scene, target: bpy.types.Object, action: str, to: bpy.types.Object | None = None
) -> bpy.types.Object | None:
    """Return the editable goal point of an object for an action (or "hinge", "handle"), if the animator has
    one in the scene.
    """
    for candidate in scene.objects:
        if (
            candidate.type == "EMPTY"
            and candidate.get(POINT_LINK) == target
            and candidate.get(POINT_ACTION) == action
        ):
            if to is None or candidate.get(POINT_TO) == to:
                return candidate
    return None


def make_point(
    name: str,
    target: bpy.types.Object,
    action: str,
    position: Array,
    heading: float,
    frame: WorldFrame,
    parent: bpy.types.Object,
) -> bpy.types.Object:
    """Add a goal point at ``position`` (3,), core frame, as a child of ``parent``, so that it goes where this
    goes.
    """
    point = bpy.data.objects.new(name, None)
    point.empty_display_type, point.empty_display_size = "ARROWS", 0.25 * frame.scale
    point.show_in_front, point.show_name = True, True
    point[POINT_LINK], point[POINT_ACTION] = target, action
    (parent.users_collection or (bpy.context.scene.collection,))[0].objects.link(point)
    place = Matrix.Translation(
        Vector(frame.to_world(np.array(position, dtype=np.float64)))
    ) @ Matrix.Rotation(heading, 4, "Z")
    point.parent = parent
    point.matrix_parent_inverse = parent.matrix_world.inverted_safe()
    point.matrix_basis = place
    return point
