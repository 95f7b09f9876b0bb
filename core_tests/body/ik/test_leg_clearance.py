"""Legs keep out of edges: what they do about a knee in one, that they do it smoothly, and nothing where it is
not called for.
"""

import numpy as np
import pytest

from nsm_core.body.contacts import ANKLES, LEGS
from nsm_core.body.ik.leg_clearance import LEAST, MOST, LegClearance, LegPose
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import INDEX, forward_kinematics
from nsm_core.data.scenarios.climb.clearance import leg_depths
from nsm_core.data.scenarios.climb.footholds import Block
from nsm_core.evaluation.measures.motion import jumps
from nsm_core.world.geometry.distance import Cuboids

BLOCK = Block(
    np.array((0.0, -0.45)), 0.0, np.array((0.8, 0.25)), 0.55
)  # its near side is at y = -0.2; -Y is ahead
HIPS = np.array((0.0, -0.08, 0.82))


@pytest.fixture
def query():
    return Cuboids(
        [(BLOCK.position, 0.0, np.array([(-0.8, -0.25, 0.0)]), np.array([(0.8, 0.25, BLOCK.height)]))]
    )


def _crouching() -> np.ndarray:
    """Local rotations (23, 4) with both feet flat on the floor before the block and the knees bent
    into it.
    """
    local = np.zeros((23, 4))
    local[:, 0] = 1
    ankles = forward_kinematics(HIPS, local)[0][list(ANKLES)]
    ankles[:, 1:] = 0.02, 0.09
    return place_limbs(HIPS, local, LEGS, ankles, local[list(ANKLES)])


def _depth(hips, local) -> float:
    return float(leg_depths(np.asarray(hips)[None], np.asarray(local)[None], BLOCK).max())


def test_a_knee_in_an_edge_comes_out_of_it_while_the_feet_stand(query):
    legs, local = LegClearance(query), _crouching()
    assert _depth(HIPS, local) > 0.1
    poses = [legs.apply(HIPS, local, 1.0, (True, True)) for _ in range(40)]
    assert _depth(*poses[-1]) < 0.02
    before = forward_kinematics(HIPS, local)[0][list(ANKLES)]
    after = np.array([forward_kinematics(*p)[0][list(ANKLES)] for p in poses])
    np.testing.assert_allclose(after, np.broadcast_to(before, after.shape), atol=0.004)
    moves = jumps(np.array([HIPS, *[p[0] for p in poses]]), np.array([local, *[p[1] for p in poses]]))
    assert moves["turn_per_frame_deg"] < 12 and moves["jolt_cm"] < 2


def test_a_swinging_foot_is_raised_out_of_the_edge(query):
    legs, local = LegClearance(query), _crouching()
    ankles = forward_kinematics(HIPS, local)[0][list(ANKLES)]
    ankles[0, 1:] = -0.3, BLOCK.height + 0.02
    local = place_limbs(HIPS, local, LEGS, ankles, local[list(ANKLES)])
    for _ in range(40):
        hips, out = legs.apply(HIPS, local, 1.0, (False, True))
    raised = forward_kinematics(hips, out)[0][list(ANKLES), 2] - ankles[:, 2]
    assert raised[0] > 0.015 and abs(raised[1]) < 0.004


def test_who_does_not_climb_is_left_alone(query):
    legs, local = LegClearance(query), _crouching()
    hips, out = legs.apply(HIPS, local, 0.0, (True, True))
    np.testing.assert_array_equal(hips, HIPS)
    np.testing.assert_array_equal(out, local)


def test_the_legs_go_back_when_the_climb_is_over(query):
    legs, local = LegClearance(query), _crouching()
    for _ in range(20):
        changed = legs.apply(HIPS, local, 1.0, (True, True))[1]
    assert np.abs(changed - local).max() > 0.02
    for _ in range(60):
        hips, out = legs.apply(HIPS, local, 0.0, (True, True))
    np.testing.assert_allclose(hips, HIPS, atol=1e-3)
    np.testing.assert_allclose(out[INDEX["RightKnee"]], local[INDEX["RightKnee"]], atol=1e-2)


def test_joints_of_changes_are_those_of_the_changed_poses():
    changes = np.random.default_rng(0).uniform(LEAST, MOST, (6, 7))
    pose = LegPose(HIPS, _crouching())
    positions = forward_kinematics(*pose.changed(changes))[0]
    assert np.allclose(pose.joints_by(changes), positions[:, np.array(LEGS).T], atol=1e-9)
