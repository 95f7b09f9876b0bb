"""Fields of a hand: distances around obstacles, closed boards, and a front that runs back along the path."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.conventions import FPS
from nsm_core.errors import GeometryError
from nsm_core.world.geometry.distance import Cuboids, Union
from nsm_core.world.geometry.revolved import Revolved
from nsm_core.world.planning.hand_fields import CELL, NEAREST, SOONEST, hand_fields, straight_in
from nsm_core.world.scene.wrist import wrist_at

JAR = Revolved([(0, -0.06), (0.04, -0.06), (0.04, 0.06), (0, 0.06)])
# A compartment that is open to -Y alone, of boards thinner than a cell.
BOARDS = np.array(
    (
        (-0.2, 0.2, -0.25, 0.218, -0.08, -0.062),
        (-0.2, 0.2, -0.25, 0.218, 0.15, 0.168),
        (-0.218, -0.2, -0.25, 0.218, -0.08, 0.168),
        (0.2, 0.218, -0.25, 0.218, -0.08, 0.168),
        (-0.2, 0.2, 0.2, 0.218, -0.08, 0.168),
    )
).reshape(5, 3, 2)
SHELF = Cuboids([((0, 0, 0), 0.0, BOARDS[..., 0], BOARDS[..., 1])])
WRIST = wrist_at(np.zeros(3), (0, 1, 0), (0, 0, 1))


@pytest.fixture(scope="module")
def fields():
    return hand_fields(JAR, SHELF, np.zeros(3), straight_in(WRIST))


def near(fields, place):
    """The cell next to a place."""
    return np.unravel_index(np.linalg.norm(fields.points - place, axis=-1).argmin(), fields.target.shape)


def test_fields_have_the_cells_and_bounds_of_the_paper(fields):
    assert fields.points.shape == (32, 32, 32, 3) and np.ptp(fields.points) < 0.8
    for field, least in ((fields.target, NEAREST), (fields.obstacles, NEAREST), (fields.arrival, SOONEST)):
        assert field.dtype == np.float32 and field.min() >= 0 and field.max() <= 1 / least + 1e-4
        assert np.isfinite(field).all() and field.max() > 0.4 / least


def test_distances_are_exact_before_the_shelf_and_go_around_it_elsewhere(fields):
    before = near(fields, (0, -0.35, 0))
    exact = JAR.signed_distance(fields.points[before][None], 1.0)[0]
    assert 1 / fields.target[before] == pytest.approx(exact, abs=0.6 * CELL)
    behind = near(fields, (0, 0.35, 0))
    assert 1 / fields.target[behind] > 0.8  # around a side, not through a board of 18 mm
    free = hand_fields(JAR, Union([]), np.zeros(3), straight_in(WRIST))
    assert 1 / free.target[behind] == pytest.approx(0.31, abs=0.6 * CELL)
    assert (free.obstacles == 0).all()
    over = near(fields, (0, 0, 0.35))
    exact = SHELF.signed_distance(fields.points[over][None], 1.0)[0]
    assert 1 / fields.obstacles[over] == pytest.approx(exact, abs=0.6 * CELL)


def test_a_hand_arrives_when_its_path_does_and_late_from_elsewhere(fields):
    path = straight_in(WRIST, 0.25, 0.8)
    made = hand_fields(JAR, SHELF, np.zeros(3), path)
    for frame in (5, 10, 15):
        at = near(made, path[frame])
        remains = (len(path) - 1 - frame) / FPS
        assert 1 / made.arrival[at] == pytest.approx(remains, rel=0.35)
    on = [1 / made.arrival[near(made, path[k])] for k in range(4, 20, 4)]
    assert on == sorted(on, reverse=True)
    aside = near(made, path[8] + (0.12, 0, 0))
    assert 1 / made.arrival[aside] > 1.2 / made.arrival[near(made, path[8])]
    assert (
        made.arrival[JAR.signed_distance(made.points.reshape(-1, 3), 1.0).reshape(made.arrival.shape) < 0]
        == 0
    ).all()


def test_a_plain_way_ends_in_the_wrist_without_a_jerk():
    path = straight_in(WRIST, 0.4, 1.0)
    assert len(path) == FPS + 1
    np.testing.assert_allclose(path[-1], WRIST.place)
    np.testing.assert_allclose(path[0], WRIST.place - 0.4 * WRIST.towards)
    assert np.abs(np.diff(path[[0, 1, -2, -1]], axis=0))[[0, 2]].max() < 1e-3


def test_ways_that_lead_nowhere_are_refused():
    with pytest.raises(GeometryError, match="two places"):
        hand_fields(JAR, SHELF, np.zeros(3), np.zeros((1, 3)))
    with pytest.raises(GeometryError, match="ends outside"):
        hand_fields(JAR, SHELF, np.zeros(3), straight_in(WRIST) + 3)
