"""Who stays where one stands: the whole state is moved and turned as one, a little at a time."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.posing import pose_of, standing_start
from nsm_core.control.standing import MOST, MOST_OFF, MOST_TURN, OFF, kept_at, kept_off
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan


def test_a_body_that_has_drifted_comes_back_as_a_whole():
    root = np.array((1.0, -2.0, 0.4), np.float32)
    state = standing_start(load_model(backend="numpy"), root, np.random.default_rng(0))
    place, heading = np.array((1.1, -2.05)), 0.9
    once = kept_at(state, place, heading)
    step = once.root[0].astype(float) - root
    assert 0.5 * MOST < np.linalg.norm(step[:2]) <= MOST + 1e-6 and 0 < step[2] <= MOST_TURN + 1e-6
    assert once.root_past[:, :-1] == pytest.approx(state.root_past[:, :-1])
    off = state.joint_position[0] - (*root[:2], 0)
    wanted = rotate_planar(off.astype(float), np.float64(step[2])) + (*(root[:2] + step[:2]), 0)
    assert once.joint_position[0] == pytest.approx(wanted, abs=1e-5)
    assert pose_of(once)[1][1:] == pytest.approx(pose_of(state)[1][1:], abs=1e-3)
    for _ in range(200):
        once = kept_at(once, place, heading)
    assert once.root[0, :2] == pytest.approx(place, abs=1e-3)
    assert abs(wrap_angle(once.root[0, 2] - heading)) < 1e-3
    assert once.root_future[0, 0, 2] - once.root[0, 2] == pytest.approx(
        state.root_future[0, 0, 2] - root[2], abs=1e-4
    )


def test_who_goes_by_a_wall_is_kept_off_it_but_stands_as_close_as_the_place_is():
    root = np.array((0.0, -0.15, 0.4), np.float32)  # a wall begins at y = 0
    wall = Cuboids([((0, 0, 0), 0.0, [(-3.0, 0.0, 0.0)], [(3.0, 0.1, 2.0)])])
    plan = FloorPlan(wall, (np.array((-3.0, -3.0)), np.array((3.0, 3.0))))
    state = standing_start(load_model(backend="numpy"), root, np.random.default_rng(0))
    far, near = np.array((2.0, -1.0)), np.array((0.1, -0.2))
    once = kept_off(state, plan, far)
    step = once.root[0].astype(float) - root
    assert -MOST_OFF - 1e-6 <= step[1] < -0.5 * MOST_OFF and abs(step[0]) < 1e-3 and step[2] == 0
    close = state
    for _ in range(100):
        once, close = kept_off(once, plan, far), kept_off(close, plan, near)
    assert once.root[0, 1] == pytest.approx(-OFF, abs=0.02)
    assert close.root[0, 1] == pytest.approx(-0.2, abs=0.02)
    assert kept_off(once, plan, near) is once
