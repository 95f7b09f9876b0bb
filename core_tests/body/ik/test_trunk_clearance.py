"""A sitter's back leans off the back rest without a jump; standing, free and front contacts change
nothing.
"""

from __future__ import annotations

import numpy as np
from walks import seated_pose

from nsm_core.body.ik.trunk_clearance import MOST_LEAN, SPEED, TrunkClearance
from nsm_core.body.skeleton import BACK_RADIUS, INDEX, forward_kinematics
from nsm_core.world.geometry.distance import Cuboids


def board(y: float, thick: float = 0.04) -> Cuboids:
    """A board across the trunk at the height of the chest, ``y`` metres from the origin (a sitter
    faces -Y).
    """
    return Cuboids([(np.zeros(3), 0.0, np.array(((-0.3, y, 0.5),)), np.array(((0.3, y + thick, 1.1),)))])


def depth(query: Cuboids, hips: np.ndarray, local: np.ndarray) -> float:
    positions, _ = forward_kinematics(hips, local)
    spine = positions[[INDEX["Chest3"], INDEX["Chest4"]]].astype(np.float32)
    return float((BACK_RADIUS - query.signed_distance(spine, 0.3)).max())


def test_back_comes_off_the_rest_smoothly_and_hips_and_feet_stay():
    hips, local = seated_pose()
    query, places = board(0.07), []
    trunk = TrunkClearance(query)
    before = depth(query, hips, local)
    for _ in range(60):
        new = trunk.apply(hips, local, 1.0)
        places.append(forward_kinematics(hips, new)[0])
    assert before > 0.04 and depth(query, hips, new) < 0.01
    assert 0 < trunk.lean < MOST_LEAN
    turns = np.abs(np.diff([p[INDEX["Head"], 1] for p in places]))
    assert (
        turns.max() < 1.2 * SPEED * 0.8
    )  # the head, 0.7 m over the pivot, never moves faster than the lean allows
    for joint in ("Hips", "LeftToe", "RightKnee"):
        assert np.allclose(places[-1][INDEX[joint]], places[0][INDEX[joint]])


def test_standing_and_free_backs_are_left_alone():
    hips, local = seated_pose()
    assert np.array_equal(TrunkClearance(board(0.07)).apply(hips, local, 0.0), local)
    assert np.array_equal(TrunkClearance(Cuboids()).apply(hips, local, 1.0), local)


def test_a_table_before_the_chest_does_not_pull_it_in():
    hips, local = seated_pose()
    trunk = TrunkClearance(board(-0.1))
    for _ in range(20):
        trunk.apply(hips, local, 1.0)
    assert trunk.lean == 0.0


def test_lean_is_given_back_once_the_sitter_rises():
    hips, local = seated_pose()
    trunk = TrunkClearance(board(0.07))
    for _ in range(40):
        trunk.apply(hips, local, 1.0)
    for _ in range(80):
        after = trunk.apply(hips, local, 0.0)
    assert np.allclose(after, local, atol=1e-3)
