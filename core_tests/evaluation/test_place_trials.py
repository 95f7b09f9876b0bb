"""What pick and place is tried with: things that stand where a hand takes things, and has room at them."""

from __future__ import annotations

import numpy as np

from nsm_core.evaluation.trials.place import taken_by_hand
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.small_things import make_thing


def standing_at(height, *around):
    """A jar on a board at a height, and whether a hand takes it among boxes ``around`` it, from its foot."""
    jar = make_thing("jar", np.random.default_rng(1), (0.0, 0.0, height, 0.0))
    boxes = [((-0.5, -0.3, -0.03), (0.5, 0.3, 0.0)), *around]
    low, high = (np.array([box[k] for box in boxes]) for k in (0, 1))
    return taken_by_hand(jar, Cuboids([((0.0, 0.0, height), 0.0, low, high)]))


def test_a_thing_is_tried_where_a_hand_takes_it():
    assert standing_at(0.9)
    assert not standing_at(0.1) and not standing_at(2.1)
    sides = [((x - 0.02, -0.3, 0.0), (x + 0.02, 0.3, 0.4)) for x in (-0.09, 0.09)]
    back = [((-0.3, y - 0.02, 0.0), (0.3, y + 0.02, 0.4)) for y in (-0.09, 0.09)]
    roof = ((-0.3, -0.3, 0.2), (0.3, 0.3, 0.22))
    assert standing_at(0.9, *sides, roof) and not standing_at(0.9, *sides, *back, roof)
