"""A hand sets out where it has room: higher, where something stands before the body."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.world.affordances.reach import Reach
from nsm_core.world.affordances.setting_out import before_body
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.hand_way import HAND, lacking
from nsm_core.world.scene.small_things import make_thing
from nsm_core.world.scene.wrist import WristPose

TOP = 0.87  # metres over the floor, of a worktop
WRIST = WristPose(np.array((-0.1, -0.05, 1.05)), np.eye(3))
REACH = Reach(np.array((0.0, -0.75)), np.pi, -1.0, 0.1, 0.6, 0.0)  # it faces +Y


def worktop(*things):
    spans = [((-1.0, -0.5, 0.0), (1.0, 0.1, TOP)), *things]
    low, high = zip(*spans, strict=True)
    return Cuboids([((0.0, 0.0, 0.0), 0.0, np.array(low), np.array(high))])


def test_what_is_held_is_brought_before_the_body_over_what_stands_there():
    held = make_thing("tin", np.random.default_rng(3), (-0.1, 0.03, 1.0, 0.0), "tin")
    free = before_body(WRIST, REACH, worktop(), held)[0]
    assert free[2] == pytest.approx(1.05)
    loaf = ((-0.1, -0.5, TOP), (0.5, -0.3, 1.08))
    begin = before_body(WRIST, REACH, worktop(loaf), held)[0]
    assert begin[2] > 1.08 + HAND


def test_a_way_tells_what_it_lacks():
    way = np.linspace((0.0, -1.0, 1.0), (0.0, -0.2, 1.0), 40)
    balls = [(np.zeros(3), 0.03), (np.array((0.0, 0.0, -0.1)), 0.04)]
    assert lacking(way, balls, worktop()) == pytest.approx(0.04 - (0.9 - TOP), abs=1e-4)
    assert lacking(way, balls[:1], worktop()) == pytest.approx(0.0, abs=1e-6)
