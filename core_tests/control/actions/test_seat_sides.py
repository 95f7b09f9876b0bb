"""Where one sits down from: before the seat, at its side where a desk stands before it, never over an arm
rest.
"""

from __future__ import annotations

import numpy as np
import pytest
from puppets import Puppet

from nsm_core.body.skeleton import HIP_OVER_SEAT
from nsm_core.control.actions.sit import before_seat
from nsm_core.control.goals import Goal
from nsm_core.conventions import GOAL_ACTIONS
from nsm_core.distances import STAND_AHEAD
from nsm_core.rotations import wrap_angle
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene import furniture
from nsm_core.world.sensors.interaction import interaction_sensor

BOUNDS = (np.array((-4.0, -4.0)), np.array((4.0, 4.0)))


def at(kind: str, desk: bool, walls: tuple[float, ...] = ()) -> tuple[Goal, FloorPlan]:
    """A seat at the origin that faces -Y, a table before it if ``desk``, walls beside it at ``walls`` (x,
    metres).
    """
    rng = np.random.default_rng(2)
    seat = furniture.make(
        kind, rng, width=0.48, depth=0.44, **({"arm_width": 0.06} if kind == "armchair" else {})
    )
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


def commanded(puppet: Puppet) -> list[tuple[str, float]]:
    """What the newest key asked for in each frame: the actions, and the heading told from that of the seat,
    degrees.
    """
    names = ["+".join(np.array(GOAL_ACTIONS)[a[-1] > 0.5]) for a in puppet.action]
    return [
        (n, round(float(np.degrees(wrap_angle(h[-1]))))) for n, h in zip(names, puppet.heading, strict=True)
    ]


def test_one_sits_with_the_back_to_the_seat_turns_to_the_desk_and_back_before_one_rises():
    goal, plan = at("chair", desk=True)
    puppet = Puppet([goal, Goal("idle", "", np.zeros(3), 0.0, hold=0.5)], root=(2.0, 0.3, 0.0), plan=plan)
    while len(puppet.roots) < 900 and puppet.step():
        pass
    assert all(r.reached for r in puppet.director.results)
    asked = commanded(puppet)
    told = [a for n, a in enumerate(asked) if a[0] == "sit" and (n == 0 or asked[n - 1] != a)]
    assert told == [("sit", 90), ("sit", 0), ("sit", 90)]
    # Nobody turns before the seat is reached, or rises before one has turned back.
    first = asked.index(("sit", 0))
    assert np.linalg.norm(puppet.roots[first][:2] - goal.position[:2]) < 0.2
    up = next(n for n in range(first, len(asked)) if asked[n][0] == "idle")
    assert abs(wrap_angle(puppet.roots[up][2] - np.pi / 2)) < np.radians(13)
    # It stands beside the seat in the end, not in the desk before it.
    assert (
        puppet.roots[-1][0] == pytest.approx(STAND_AHEAD, abs=0.1)
        and abs(puppet.roots[-1][1] - goal.position[1]) < 0.15
    )


def test_one_who_is_asked_to_sit_where_one_sits_at_a_desk_stays():
    goal, plan = at("stool", desk=True)
    puppet = Puppet(
        [goal, Goal("sit", "again", goal.position, goal.heading, hold=0.5)], root=(2.0, 0.3, 0.0), plan=plan
    )
    while len(puppet.roots) < 900 and puppet.step():
        pass
    asked = commanded(puppet)
    assert all(r.reached for r in puppet.director.results)
    assert {a for a in asked[asked.index(("sit", 0)) :]} == {("sit", 0)}
