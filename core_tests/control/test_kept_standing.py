"""Who stays where one stands: the whole state is moved and turned as one, a little at a time."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.posing import pose_of, standing_start
from nsm_core.control.standing import MOST, MOST_TURN, kept_at
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import rotate_planar, wrap_angle


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
