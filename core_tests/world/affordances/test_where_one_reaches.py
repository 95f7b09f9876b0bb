"""Where one stands to reach with one hand: on this side of walls, before what is reached, with room."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.rotations import heading_to_direction, matrix_from_forward_up, wrap_angle
from nsm_core.world.affordances.reach import LEFT, RIGHT, least_strained, reaches
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.wrist import WristPose

UP = np.array((0.0, 0.0, 1.0))
WALL = ((-2.0, 0.0, 0.0), (2.0, 0.1, 2.5))
WORKTOP = ((-2.0, -0.3, 0.8), (2.0, 0.0, 0.85))
SIDE = ((0.28, -1.2, 0.0), (0.6, -0.3, 1.8))  # a cupboard that stands out beside it


def solid(*boxes):
    return Cuboids([((0, 0, 0), 0.0, [b[0] for b in boxes], [b[1] for b in boxes])])


def room(query):
    return FloorPlan(query, (np.array((-3.0, -3.0)), np.array((3.0, 3.0)))).clearance


def over_the_worktop(ahead=(0.0, 0.0, -1.0)):
    """A wrist over the back of a worktop, from above if not told."""
    ahead = np.array(ahead)
    thumb = np.eye(3)[0] if abs(ahead[2]) > 0.9 else UP
    return WristPose(np.array((0.0, -0.12, 1.08)), matrix_from_forward_up(ahead, thumb))


@pytest.mark.parametrize("side", [RIGHT, LEFT])
def test_nobody_reaches_through_a_wall(side):
    query = solid(WALL, WORKTOP)
    found = least_strained(over_the_worktop(), query, side, room(query))
    assert found is not None and found.place[1] < -0.3
    assert all(r.place[1] < -0.3 for r in reaches(over_the_worktop(), query))
    # Without the wall the other side is nearer to it.
    assert any(r.place[1] > 0.0 for r in reaches(over_the_worktop(), solid(WORKTOP)))


def test_one_stands_before_what_one_reaches_and_hardly_twists():
    query = solid(WALL, WORKTOP)
    wrist = over_the_worktop((0.94, 0.34, 0.0))
    found = least_strained(wrist, query, LEFT, room(query))
    ahead = heading_to_direction(np.array(found.heading))
    to = wrist.place[:2] - found.place
    bearing = wrap_angle(np.arctan2(to[0], -to[1]) - np.arctan2(ahead[0], -ahead[1]))
    assert abs(bearing) < np.radians(45)


def test_one_stands_rather_where_hips_and_elbows_have_room():
    wrist = over_the_worktop((0.0, 1.0, 0.0))
    free, beside = (solid(WALL, WORKTOP, *more) for more in ((), (SIDE,)))
    far = [least_strained(wrist, query, LEFT, room(query)).place[0] for query in (free, beside)]
    assert far[1] < far[0] - 0.04 or far[1] < 0.28 - 0.3


def test_one_stands_as_far_from_what_one_reaches_over_as_an_arm_allows():
    wrist = WristPose(np.array((0.0, -0.2, 1.05)), matrix_from_forward_up(np.array((0.0, 1.0, 0.0)), UP))
    query = solid(WALL, WORKTOP)
    found, nearest = least_strained(wrist, query, LEFT, room(query)), reaches(wrist, query, (LEFT,))[0]
    about = room(query)(np.stack((found.place, nearest.place)))
    assert about[0] > 0.28 and about[1] < 0.23
