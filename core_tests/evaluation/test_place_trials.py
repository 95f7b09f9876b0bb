"""What pick and place is tried with: things that stand where a hand takes things, and has room at them."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.capsules import Body
from nsm_core.control.insight import Insight
from nsm_core.control.request import TakeResult
from nsm_core.evaluation.measures.touches import told, touches
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


def test_what_is_touched_is_told_by_part_thing_and_time():
    hips, turns = np.tile((0.0, 0.0, 0.96), (10, 1)), np.tile((1.0, 0.0, 0.0, 0.0), (10, 23, 1))
    tip = (body := Body.of(hips, turns)).centres[0, :, 0] + body.radii[0]
    hips[3:6, 0] += 0.03
    mug = make_thing("jar", np.random.default_rng(1), (5.0, 0.0, 1.0, 0.0))
    poses = np.repeat(mug.pose[None], 10, 0)
    poses[:, 0] += 0.01 * np.arange(10)
    poses[4, 2] -= 0.02
    post, board = ((float(tip.max()), -1.0, 0.0), (1.5, 1.0, 3.0)), ((4.0, -1.0, 0.9), (6.0, 1.0, 0.999))
    solids = {
        name: Cuboids([((0.0, 0.0, 0.0), 0.0, [low], [high])])
        for name, (low, high) in {"post": post, "board": board}.items()
    }
    seen = {4: Insight(hips[4], 0.0, hips[4], None, hips[4], hips[4], hips[4], "carry mug")}
    none = np.zeros((10, 0))
    take = TakeResult(
        hips, turns, hips, turns, none, none, none, none, [], {}, props={"mug": poses}, insights=seen
    )
    hand, thing = touches(take, solids, {"mug": mug}, 0.02, 0.01)
    assert (hand.part, hand.what, hand.first, hand.last) == ("LeftWrist", "post", 3, 5)
    assert hand.depth == pytest.approx(0.03, abs=1e-3) and hand.doing == "on the way"
    assert (thing.part, thing.what, thing.frame, thing.doing) == ("mug", "board", 4, "carry mug")
    assert told([thing]).startswith("mug 1.9 cm in board at 0.98 m, frames 4 to 4")
