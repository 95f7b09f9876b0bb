"""Far and large floors: looked at where something is asked alone, ways in larger cells and round what stands
in them, and limits.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GoalError
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.cheapest_way import cheapest
from nsm_core.world.planning.clearance_map import BODY_RADIUS
from nsm_core.world.planning.floor_plan import FloorPlan, path_length


class Named(Cuboids):
    """Boxes with a name each, which counts the points that are asked."""

    def __init__(self, boxes):
        super().__init__([((0, 0, 0), 0.0, [low], [high]) for low, high in boxes.values()])
        self.boxes = boxes
        self.names, self.asked = list(boxes), 0
        self.each = [Cuboids([((0, 0, 0), 0.0, [low], [high])]) for low, high in boxes.values()]

    def signed_distance(self, points, max_distance):
        self.asked += len(points)
        return super().signed_distance(points, max_distance)

    def without(self, name):
        return Named({n: b for n, b in self.boxes.items() if n != name})

    def nearest(self, points, max_distance):
        distances = np.stack(
            [q.signed_distance(np.asarray(points, np.float32), max_distance) for q in self.each]
        )
        return [
            self.names[k] if d < max_distance else None
            for k, d in zip(distances.argmin(0), distances.min(0), strict=True)
        ]


def wall(x0, x1, y):
    return (x0, y, 0.0), (x1, y + 0.2, 2.5)


def test_a_straight_way_over_hundreds_of_metres_looks_at_its_own_floor_alone():
    query = Named({"Wall": wall(300, 340, 100)})
    plan = FloorPlan(query, ((-400, -400), (400, 400)))
    way = plan.find(np.array((-350.0, -350.0)), np.array((340.0, -300.0)))
    assert path_length(way) == pytest.approx(np.hypot(690, 50), abs=0.1)
    assert query.asked < 200_000  # a floor of 800 m a side has 64 million nodes, and six heights


def test_the_same_clearance_wherever_it_is_asked_first():
    query = Named({"Wall": wall(-3, 2, 1), "Post": ((3.0, -2, 0), (3.3, -1.7, 2))})
    points = np.random.default_rng(0).uniform(-9, 9, (2000, 2))
    whole, single = (FloorPlan(query, ((-10, -10), (10, 10))) for _ in range(2))
    at_once = whole.clearance(points)
    np.testing.assert_array_equal(at_once, np.concatenate([single.clearance(p[None]) for p in points]))
    more = whole.besides(
        Cuboids([((0, 0, 0), 0.0, [(-1, -5, 0)], [(1, -4, 1)])]), np.array(((0.0, -4.5),)), 1.2
    )
    assert (more.clearance(points) <= at_once + 1e-9).all() and (more.clearance(points) < at_once - 0.1).any()
    np.testing.assert_array_equal(whole.clearance(points), at_once)


@pytest.mark.parametrize("goal", [(60.0, 80.0), (350.0, 350.0)])
def test_a_way_leads_round_what_stands_far_away(goal):
    goal = np.array(goal)
    query = Named({"Wall": wall(-30, 40, 20)})
    plan = FloorPlan(query, (np.minimum(goal, 0) - 8, goal + 8))
    way = plan.find(np.zeros(2), goal)
    np.testing.assert_allclose((way[0], way[-1]), (np.zeros(2), goal), atol=1e-6)
    assert plan.clearance(way).min() > BODY_RADIUS - 0.05
    round_its_end = np.hypot(40, 20) + np.linalg.norm(goal - (40, 20))
    assert path_length(way) < 1.15 * round_its_end
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() < 0.2


def test_what_lies_out_of_reach_is_told_in_metres():
    plan = FloorPlan(Cuboids(), ((-10, -10), (4000, 10)))
    with pytest.raises(GoalError, match="3000 m to .* up to 1000 m"):
        plan.find(np.zeros(2), np.array((3000.0, 0.0)))


@pytest.mark.parametrize("start", [(0.0, -3.0), (0.0, 0.0)])
def test_what_keeps_one_out_or_in_is_named(start):
    sides = {
        "left": ((-1.2, -1, 0), (-1, 1, 2)),
        "right": ((1, -1, 0), (1.2, 1, 2)),
        "back": ((-1, 1, 0), (1, 1.2, 2)),
    }
    boxes = {**sides, "Fence": ((-1, -1.2, 0), (1, -1, 1)), "Far": ((5, 5, 0), (6, 6, 2))}
    plan = FloorPlan(Named(boxes), ((-8, -8), (8, 8)))
    goal = np.zeros(2) if start[1] else np.array((0.0, -4.0))
    with pytest.raises(GoalError, match="'Fence' stands in it.*nsm_collider"):
        plan.find(np.array(start), goal)
    unnamed = FloorPlan(
        Cuboids([((0, 0, 0), 0.0, [low], [high]) for low, high in boxes.values()]), ((-8, -8), (8, 8))
    )
    with pytest.raises(GoalError, match="move the furniture apart"):
        unnamed.find(np.array(start), goal)


def test_the_cheapest_way_goes_round_what_is_dear_or_closed():
    price = np.ones((7, 7))
    price[3, :6] = np.inf
    way = cheapest(price, (0, 0), (6, 0))
    assert way[0].tolist() == [0, 0] and way[-1].tolist() == [6, 0] and [3, 6] in way.tolist()
    price[3, 6] = np.inf
    assert cheapest(price, (0, 0), (6, 0)) is None
    price[3] = 50.0
    price[3, 2] = 2.0
    assert [3, 2] in cheapest(price, (0, 0), (6, 0)).tolist()
