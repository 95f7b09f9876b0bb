"""Seats: where the hips come to rest, proposed from the mesh or set by the animator."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.body.skeleton import HIP_OVER_SEAT
from nsm_core.control.goals import Goal
from nsm_core.distances import STAND_AHEAD
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import heading_to_direction
from nsm_core.world.affordances.seat import find_seat

from ..world.bodies import GoalBody, place_of
from ..world.surroundings import Surroundings
from .finder import Finder, Place, on_top
from .looks import Looks
from .loose_parts import seat_body
from .points import goal_point_of
from .spec import GoalSpec
from .walk import require_support

# Seats that a person of the skeleton's size can use, metres over the floor.
LOWEST_SEAT, HIGHEST_SEAT = 0.25, 0.8
_NO_TABLE = 0.62  # metres: level tops that are higher, without a back, are tables


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
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
    stand = seat_point[:2] + STAND_AHEAD * heading_to_direction(np.array(heading))
    ground = float(around.ground.height(stand[None])[0])
    if not LOWEST_SEAT <= seat_point[2] - ground <= HIGHEST_SEAT:
        raise GoalError(
            f"The seat of {spec.object.name} is {(seat_point[2] - ground) * frame.scale:.2f} m over the "
            "character's floor; people sit "
            f"between {LOWEST_SEAT * frame.scale:.2f} and {HIGHEST_SEAT * frame.scale:.2f} m: move the goal "
            "point or the object."
        )
    if point is not None:
        require_support(spec.object.name, seat_point, around)
    hips = seat_point + np.array((0, 0, HIP_OVER_SEAT), np.float32)
    return Goal("sit", spec.label, hips.astype(np.float32), heading, spec.hold, body.interaction(along))


def _somewhere(body: GoalBody) -> Place:
    return on_top(body, LOWEST_SEAT, HIGHEST_SEAT)


def _likely(looks: Looks) -> float:
    """A seat with a back is one for certain; without, it has legs and the height of a stool or bench."""
    seat = looks.seat
    if seat is None or not LOWEST_SEAT <= seat.height <= HIGHEST_SEAT:
        return 0.0
    if seat.back:
        return 3.0
    if seat.height > _NO_TABLE:
        return 0.0
    return 0.6 if looks.massive else 1.5


FINDER = Finder(
    _find,
    somewhere=_somewhere,
    under=lambda goal: HIP_OVER_SEAT,
    words=(
        "chair", "armchair", "seat", "sofa", "couch", "bench", "stool", "pouf", "ottoman", "bed", "throne",
    ),
    likely=_likely,
    loose=True,
)  # fmt: skip
