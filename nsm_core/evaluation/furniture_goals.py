"""Goals at pieces of furniture, for trials and scripts; in Blender they are found in a scene."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import HIP_OVER_SEAT
from nsm_core.control.goals import Goal
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.affordances.seat import find_seat
from nsm_core.world.affordances.standing import BEHIND_WALL
from nsm_core.world.scene.furniture import Furniture, cuboids
from nsm_core.world.sensors.interaction import interaction_sensor


def sit_goal(piece: Furniture, place: Array, turn: float, known: bool = False, hold: float = 1.0) -> Goal:
    """The goal to sit on ``piece``, which stands at ``place`` (2,) with heading ``turn``.

    A seat that is ``known`` is taken where the piece says it is; else it is found from its mesh, as in
    Blender.  Raises GeometryError where nobody can sit.
    """
    angle = np.float64(turn)
    seat = piece.seat if known and piece.seat is not None else find_seat(piece.vertices, piece.triangles)
    centre = np.append(place + rotate_planar(piece.centre[:2], angle), piece.centre[2])
    volume = interaction_sensor(cuboids([(piece, place, turn)]), centre, piece.size, turn)
    hips = np.append(place + rotate_planar(seat.point[:2], angle), seat.point[2] + HIP_OVER_SEAT)
    return Goal("sit", piece.kind, hips, seat.heading + turn, hold, volume)


def climb_goal(piece: Furniture, place: Array, turn: float, coming_from: Array, hold: float = 1.0) -> Goal:
    """The goal to climb ``piece``, which stands at ``place`` (2,) with heading ``turn``, for one who comes
    from ``coming_from`` (2,).

    A step is climbed from the side nearest to the start, a low wall across; the sensor looks at it from that
    side, as in Blender.
    """
    half = piece.size[:2] / 2
    local = rotate_planar(np.asarray(coming_from, dtype=np.float64)[:2] - place, np.float64(-turn))
    wall = piece.kind == "low_wall"
    outside = [-local[1] - half[1], local[0] - half[0], local[1] - half[1], -local[0] - half[0]]
    quarter = max((0, 2) if wall else range(4), key=lambda q: outside[q])
    heading = turn + quarter * np.pi / 2 + np.pi
    stand = np.append(place, 0.0 if wall else piece.size[2]).astype(np.float64)
    if wall:
        stand[:2] += (half[1] + BEHIND_WALL) * heading_to_direction(np.array(heading))
    size = piece.size[[1, 0, 2]] if quarter % 2 else piece.size
    centre = np.append(place + rotate_planar(piece.centre[:2], np.float64(turn)), piece.centre[2])
    volume = interaction_sensor(cuboids([(piece, place, turn)]), centre, size, heading + np.pi)
    return Goal("climb", piece.kind, stand, float(heading), hold, volume)
