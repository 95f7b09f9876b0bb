"""Ways over the floor: short, smooth, clear of furniture, and a plain sentence where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GoalError, NsmError
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.clearance_map import BODY_RADIUS, HEIGHTS
from nsm_core.world.planning.floor_plan import FloorPlan, line_is_free, path_length, resample_path

ROOM = ((-4.0, -4.0), (4.0, 4.0))


def box(
    centre: tuple[float, float],
    size: tuple[float, float],
    top: float = 1.0,
    heading: float = 0.0,
    bottom: float = 0.0,
) -> tuple:
    half = np.array(size) / 2
    return np.array(centre), heading, np.array(((*-half, bottom),)), np.array(((*half, top),))


def plan_path(
    query: Cuboids, start: tuple[float, float], goal: tuple[float, float], margin: float = 2.0
) -> np.ndarray:
    """The way on a floor of ``margin`` metres around its ends."""
    ends = np.array((start, goal), dtype=np.float64)
    return FloorPlan(query, (ends.min(0) - margin, ends.max(0) + margin)).find(*ends)


def clear(query: Cuboids, path: np.ndarray) -> float:
    """True clearance of a path, from the solids themselves."""
    body = np.concatenate([np.insert(path, 2, z, axis=1) for z in np.arange(0.15, 1.7, 0.05)])
    return float(query.signed_distance(body, 2.0).min())


def curvature(path: np.ndarray) -> np.ndarray:
    """Curvature 1/m measured over 20 cm of a path with points 5 cm apart."""
    d = np.diff(path, axis=0)
    angle = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    return np.abs(angle[4:] - angle[:-4]) / 0.2


def test_empty_floor_is_crossed_straight():
    path = plan_path(Cuboids(), (0, 0), (3, 4))
    assert (
        path_length(path) == pytest.approx(5)
        and np.allclose(path[0], (0, 0))
        and np.allclose(path[-1], (3, 4))
    )
    assert np.allclose(np.linalg.norm(np.diff(path, axis=0), axis=-1), 0.05, atol=1e-3)


def test_an_end_that_is_just_free_between_cells_that_are_not_is_reached():
    query = Cuboids([box((0, 0), (1.6, 0.98), 0.75)])  # the cell nearest to 0.773 lies at 0.75, 1 cm short
    path = plan_path(query, (0, -1.5), (0, 0.773))
    assert np.allclose(path[-1], (0, 0.773)) and clear(query, path) > BODY_RADIUS - 0.03


@pytest.mark.parametrize("heading", [0.0, 0.4])
def test_way_around_a_table(heading):
    query = Cuboids([box((0, 0), (1.6, 0.9), 0.75, heading)])
    path = plan_path(query, (-2.5, 0.05), (2.5, 0.0))
    assert np.allclose(path[0], (-2.5, 0.05)) and np.allclose(path[-1], (2.5, 0))
    assert clear(query, path) > BODY_RADIUS - 0.03
    assert 5.0 < path_length(path) < 5.9
    assert curvature(path).max() < 3.0
    assert np.abs(np.linalg.norm(np.diff(path, axis=0), axis=-1) - 0.05).max() < 0.003


def test_thin_table_top_is_an_obstacle_and_a_lamp_is_not():
    for height in (*HEIGHTS, 0.3, 0.6, 0.9, 1.2, 1.5):
        board = Cuboids([box((0, 0), (1.5, 1.5), height + 0.01, bottom=height - 0.01)])
        assert not line_is_free(board, (-2, 0), (2, 0)), f"a board at {height} m is walked through"
        assert path_length(plan_path(board, (-2, 0), (2, 0))) > 4.2
    lamp = Cuboids([box((0, 0), (0.5, 0.5), 2.6, bottom=2.2)])
    assert path_length(plan_path(lamp, (-2, 0), (2, 0))) == pytest.approx(4)


def test_door_in_a_wall_is_found():
    # 90 cm between -0.5 and 0.4.
    wall = Cuboids([box((0, -2.5), (0.1, 4.0), 2.5), box((0, 2.4), (0.1, 4.0), 2.5)])
    plan = FloorPlan(wall, ROOM)
    path = plan.find((-2, 2), (2, 2))
    at_wall = path[np.abs(path[:, 0]) < 0.1]
    assert np.abs(at_wall[:, 1] + 0.05).max() < 0.18
    assert clear(wall, path) > BODY_RADIUS - 0.03


def test_random_rooms_keep_clear_of_furniture():
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(12):
        tops = rng.choice((0.45, 0.75, 1.8), 8)
        objects = [
            box(rng.uniform(-3, 3, 2), rng.uniform(0.4, 1.4, 2), top, rng.uniform(-3, 3)) for top in tops
        ]
        query = Cuboids(objects)
        plan = FloorPlan(query, ROOM)
        ends = rng.uniform(-3.8, 3.8, (2, 2))
        if plan.clearance(ends).min() < BODY_RADIUS + 0.02:
            continue
        try:
            path = plan.find(*ends)
        except GoalError:
            continue
        found += 1
        assert clear(query, path) > BODY_RADIUS - 0.04
        assert curvature(path).max(initial=0) < 5.0
        assert np.allclose(path[[0, -1]], ends)
    assert found >= 5


def test_clearance_is_the_true_distance():
    query = Cuboids([box((0.5, 0.2), (1.0, 0.6), 1.0, 0.3)])
    points = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    truth = np.stack([query.signed_distance(np.insert(points, 2, z, axis=1), 0.7) for z in HEIGHTS]).min(0)
    assert np.abs(FloorPlan(query, ROOM).clearance(points) - truth)[truth > 0].max() < 0.05


def test_leaving_a_seat_against_the_wall():
    """From a chair with its back to a wall and a table at its side, the way leads out at the front, not
    through the back rest.
    """
    seat, rest = ((-0.25, -0.25, 0.4), (0.25, 0.25, 0.45)), ((-0.25, 0.2, 0.45), (0.25, 0.25, 0.95))
    chair = (np.zeros(2), 0.0, np.array((seat[0], rest[0])), np.array((seat[1], rest[1])))
    query = Cuboids([chair, box((0, 0.5), (4, 0.2), 2.5)])
    path = plan_path(query, (0.0, 0.05), (2.0, 2.0), margin=3.0)
    leaving = path[np.linalg.norm(path, axis=-1) < 0.6]
    assert leaving[:, 1].max() < 0.1 and clear(query, path[-20:]) > BODY_RADIUS - 0.03
    assert clear(query, plan_path(query, (-2.0, -1.5), (0.0, -0.5))[:20]) > BODY_RADIUS - 0.03


def test_no_way_says_what_to_do():
    pen = [box((0, y), (2.2, 0.1), 2) for y in (-1, 1)] + [box((x, 0), (0.1, 2.2), 2) for x in (-1, 1)]
    with pytest.raises(GoalError, match="move the furniture"):
        plan_path(Cuboids(pen), (-2.5, 0), (0, 0))
    with pytest.raises(GoalError, match="off the planned floor"):
        FloorPlan(Cuboids(), ROOM).find((0, 0), (9, 0))
    with pytest.raises(GoalError, match="off the planned floor"):
        FloorPlan(Cuboids(), ROOM).find((0, 0), (np.nan, 0))
    with pytest.raises(NsmError, match="no size"):
        FloorPlan(Cuboids(), ((0, 0), (0, 5)))


def test_line_of_sight_of_plan_and_of_solids_agree():
    query = Cuboids([box((0, 0), (1, 1), 1.0, 0.7)])
    plan = FloorPlan(query, ROOM)
    rng = np.random.default_rng(1)
    same = [
        plan.line_is_free(a, b) == line_is_free(query, a, b) for a, b in rng.uniform(-2.5, 2.5, (60, 2, 2))
    ]
    assert np.mean(same) > 0.95
    assert line_is_free(plan, (-2, -2), (-2, 2)) and not line_is_free(plan, (-2, 0), (2, 0))


def test_start_at_the_goal():
    path = plan_path(Cuboids(), (1, 1), (1, 1))
    assert path.shape == (1, 2) and path_length(path) == 0
    assert resample_path(np.array(((0.0, 0), (0, 0), (1, 0))), 0.25).shape == (5, 2)


@pytest.mark.parametrize("depth", [1.2, 1.9, 3.6])
def test_tops_of_any_depth_are_left(depth):
    podium = Cuboids(
        [
            (
                (0.0, 0.0),
                0.0,
                np.array([(-depth / 2, -depth / 2, 0.0)]),
                np.array([(depth / 2, depth / 2, 0.3)]),
            )
        ]
    )
    plan = FloorPlan(podium, (np.array((-5.0, -5.0)), np.array((5.0, 5.0))))
    way = plan.find((0.0, 0.1), (0.5, -4.0))
    np.testing.assert_allclose(way[[0, -1]], ((0.0, 0.1), (0.5, -4.0)), atol=1e-6)
    off = np.abs(way).max(1) > depth / 2 + BODY_RADIUS
    assert off[-1] and np.linalg.norm(way[np.argmax(off)]) < depth / 2 * 1.45 + 0.8, (
        "it gets off on the shortest ways"
    )
    if depth > 1.5:
        with pytest.raises(GoalError, match="no free way"):  # but nobody walks into the middle of a deep one
            plan.find((0.5, -4.0), (0.0, 0.1))
