"""Ways of a wrist: past what stands there, timed as people reach, and turned as another one was."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import quat_from_axis_angle, quat_to_matrix
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.hand_fields import CELL, hand_space
from nsm_core.world.planning.hand_way import HAND, filled, timed, turned_along, way_past
from nsm_core.world.scene.small_things import make_thing


def boxes(*corners):
    lows, highs = zip(*corners, strict=True)
    return Cuboids([((0, 0), 0.0, lows, highs)])


THING = boxes(((-0.03, -0.03, -0.03), (0.03, 0.03, 0.03)))


def test_a_way_goes_around_what_is_before_the_thing():
    wall = boxes(((-0.15, -0.2, -0.4), (0.4, -0.17, 0.4)))
    end, begin = np.array((0.0, -0.11, 0.0)), np.array((0.1, -0.8, 0.0))
    way = way_past(hand_space(THING, wall, np.zeros(3)), end, begin, HAND, around_target=True)
    assert np.allclose(way[-1], end) and np.linalg.norm(way[0] - end) > 0.25
    assert wall.signed_distance(way.astype(np.float32), 1.0).min() > 0.75 * HAND
    open_ = way_past(hand_space(THING, boxes(((5, 5, 5), (6, 6, 6))), np.zeros(3)), end, begin, HAND, True)
    length = np.linalg.norm(np.diff(open_, axis=0), axis=1).sum()
    # Straight where nothing is in the way.
    assert length < 1.05 * np.linalg.norm(open_[0] - end)
    assert np.linalg.norm(open_[0] - begin) < np.linalg.norm(end - begin) - 0.25


def test_no_way_leads_out_of_a_closed_box():
    sides = [((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2))]
    walls = []
    for axis in range(3):
        for sign in (-1, 1):
            low, high = (np.array(c, float) for c in sides[0])
            low[axis], high[axis] = sorted((sign * 0.2, sign * 0.24))
            walls.append((tuple(low), tuple(high)))
    space = hand_space(THING, boxes(*walls), np.zeros(3))
    assert way_past(space, np.array((0.0, -0.1, 0.0)), np.array((0, -1.0, 0)), HAND, True) is None


def test_a_hand_goes_from_rest_to_rest_no_faster_than_is_said():
    path = timed(np.array(((0.0, 0, 0), (0.3, 0, 0), (0.3, 0.4, 0))), 0.9)
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) * 30
    assert 0.8 < speed.max() <= 0.9 and speed[0] < 0.1 > speed[-1]
    assert np.allclose(path[-1], (0.3, 0.4, 0))


def test_a_wrist_is_turned_as_its_way_is():
    line = timed(np.array(((0.0, 0, 0), (0.5, 0, 0))), 0.8)
    held = np.repeat(quat_to_matrix(quat_from_axis_angle(np.array((0.0, 1, 0)), 0.3))[None], len(line), 0)
    assert np.allclose(turned_along(line, line, held), held, atol=1e-6)
    turn = quat_to_matrix(quat_from_axis_angle(np.array((0.0, 0, 1)), 0.7))
    assert np.allclose(turned_along(line @ turn.T, line, held), turn @ held, atol=1e-5)
    longer = timed(np.array(((-0.5, 0, 0), (0.5, 0, 0))), 0.8)
    assert np.allclose(turned_along(longer, line, held), held[0], atol=1e-6)


def test_what_goes_along_with_a_wrist_goes_over_an_edge_too():
    """A deep board, past whose edge the wrist comes from below; what it holds is ahead of it."""
    board = ((-0.4, -0.18, -0.2), (0.4, 0.4, -0.06))
    end, begin = np.array((0.0, -0.1, 0.0)), np.array((0.0, -0.33, -0.3))
    ahead = np.array((0.0, 0.16, 0.0))
    solid = boxes(board)
    space = hand_space(THING, solid, np.zeros(3))
    least = []
    for balls in ((), [(ahead, 0.05)]):
        for firm in (True, False):
            way = way_past(space, end, begin, 0.02, False, True, balls if firm else (), () if firm else balls)
            least.append(solid.signed_distance((way + ahead).astype(np.float32), 1.0).min())
    assert max(least[:2]) < 0.02 and min(least[2:]) > 0.05 - CELL
    roofed = hand_space(THING, boxes(board, ((-0.4, -0.3, 0.05), (0.4, 0.4, 0.2))), np.zeros(3))
    wide = [(ahead, 0.09)]
    assert way_past(roofed, end, begin, 0.02, False, True, wide) is None
    assert way_past(roofed, end, begin, 0.02, False, True, (), wide) is not None


def test_a_box_is_filled_to_its_corners():
    book = make_thing("cookbook", np.random.default_rng(3), (1.0, 2.0, 0.5, 0.7))
    balls = filled(book)
    local = book.to_local(np.array([place for place, _ in balls]))
    radius = balls[0][1]
    assert np.allclose(local.min(0) - radius, book.low) and np.allclose(local.max(0) + radius, book.high)
