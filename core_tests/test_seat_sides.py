"""Where one sits down from: before the seat, at its side where a desk stands before it, never over an arm rest."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core import furniture
from nsm_core.control.goals import STAND_AHEAD, Goal
from nsm_core.control.planning import FloorPlan
from nsm_core.control.stages.seats import before_seat
from nsm_core.rotations import wrap_angle
from nsm_core.sensors.cuboid import interaction_sensor
from nsm_core.skeleton import HIP_OVER_SEAT

BOUNDS = (np.array((-4.0, -4.0)), np.array((4.0, 4.0)))


def at(kind: str, desk: bool, walls: tuple[float, ...] = ()) -> tuple[Goal, FloorPlan]:
    """A seat at the origin that faces -Y, a table before it if ``desk``, walls beside it at ``walls`` (x, metres)."""
    rng = np.random.default_rng(2)
    seat = furniture.make(kind, rng, width=0.48, depth=0.44, **({"arm_width": 0.06} if kind == "armchair" else {}))
    placed = [(seat, np.zeros(2), 0.0)]
    hips = np.append(seat.seat.point[:2], seat.seat.height + HIP_OVER_SEAT)
    volume = interaction_sensor(furniture.cuboids(placed), seat.centre, seat.size, 0.0)
    if desk:
        table = furniture.make("table", rng, width=1.2, depth=0.7, legs="posts")
        placed.append((table, np.array((0.0, float(hips[1]) - 0.3 - 0.35)), 0.0))
    for x in walls:
        placed.append((furniture.make("wall", rng, width=2.0, depth=0.1), np.array((x, 0.0)), np.pi / 2))
    return Goal("sit", kind, hips, 0.0, interaction=volume), FloorPlan(furniture.cuboids(placed), BOUNDS)


def test_before_the_seat_where_nothing_stands_there():
    goal, plan = at("chair", desk=False)
    stand, heading = before_seat(goal, plan, np.array((2.0, 0.0)))
    np.testing.assert_allclose(stand, goal.position[:2] + (0, -STAND_AHEAD), atol=1e-6)
    assert heading == 0.0


@pytest.mark.parametrize("x", [2.0, -2.0])
def test_from_the_nearer_side_at_a_desk(x):
    goal, plan = at("chair", desk=True)
    stand, heading = before_seat(goal, plan, np.array((x, 0.0)))
    assert np.sign(stand[0]) == np.sign(x) and abs(stand[0]) == pytest.approx(STAND_AHEAD, abs=0.01)
    assert abs(wrap_angle(heading)) == pytest.approx(np.pi / 2)
    # The back is turned to the seat.
    assert np.sign(np.sin(heading)) == np.sign(x)


def test_from_the_other_side_where_one_is_walled_up():
    goal, plan = at("stool", desk=True, walls=(0.55,))
    stand, _ = before_seat(goal, plan, np.array((2.0, 0.0)))
    assert stand[0] < 0


def test_never_over_an_arm_rest():
    goal, plan = at("armchair", desk=True)
    stand, heading = before_seat(goal, plan, np.array((2.0, 0.0)))
    assert heading == 0.0 and stand[1] < goal.position[1]
