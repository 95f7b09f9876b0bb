"""What is carried goes over what stands about, as little as it takes, and not into what is over it."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.actions.carried import KEEPS, over
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.small_things import make_thing

FOOT = 0.96  # metres over the floor


@pytest.fixture
def mug():
    return make_thing("mug", np.random.default_rng(3), (0.0, 0.0, FOOT, 0.0), "mug")


def boxes(*spans):
    low, high = zip(*spans, strict=True)
    return Cuboids([((0.0, 0.0, 0.0), 0.0, np.array(low), np.array(high))])


def test_nothing_about_leaves_it_where_it_is(mug):
    assert over(mug, boxes(((2.0, 2.0, 0.0), (3.0, 3.0, 2.0)))) == 0.0


def test_it_goes_over_what_is_lower_and_not_past_what_is_over_it(mug):
    near = float(mug.high[0]) + 0.5 * KEEPS
    jar = (near, -0.05, 0.87), (near + 0.1, 0.05, FOOT + 0.05)
    lift = over(mug, boxes(jar))
    assert 0.05 < lift <= 0.12
    raised = mug.put(mug.pose + (0, 0, lift, 0))
    assert over(raised, boxes(jar)) == 0.0
    board = (-0.3, -0.3, FOOT + float(mug.size[2]) + 0.07), (0.3, 0.3, FOOT + float(mug.size[2]) + 0.09)
    assert over(mug, boxes(jar, board)) == 0.0
