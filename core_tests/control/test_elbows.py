"""Elbows of arms that are led: they go where the arm has room, and stay where it has it anyway."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.capsules import BUNDLED
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import ARMS, OFFSETS, J
from nsm_core.control.actions.hold import Lead
from nsm_core.control.elbows import with_room
from nsm_core.rotations import quat_from_rotvec
from nsm_core.world.geometry.distance import Cuboids

FRAMES, LED = 90, slice(30, 60)
SHOULDER, ELBOW, WRIST = ARMS[1]


@pytest.fixture
def reaching():
    """A body that stands with its left arm bent ahead, the elbow hanging, and leads of that hand for a
    while.
    """
    turns = np.zeros((FRAMES, J, 3))
    turns[:, SHOULDER] = (0.0, 1.0, 0.0)
    turns[:, ELBOW] = (0.0, 0.0, -1.5)
    pose = Pose(BUNDLED.tree, np.tile(OFFSETS[0].astype(float), (FRAMES, 1)), quat_from_rotvec(turns))
    leads = [[] for _ in range(FRAMES)]
    for t in range(FRAMES)[LED]:
        leads[t] = [Lead(1, pose.positions[t, WRIST], 1.0, bends=True)]
    return pose, leads


def depth(pose: Pose, solid: Cuboids) -> np.ndarray:
    """How deep (T,) the left forearm is in a solid."""
    centres, radii = BUNDLED.spheres.of(pose.positions, pose.world)
    own = np.flatnonzero(BUNDLED.spheres.forearm == 1)
    far = solid.signed_distance(centres[:, own].reshape(-1, 3).astype(np.float32), 0.2)
    return (radii[:, own] - far.reshape(FRAMES, -1)).max(1)


def board_in(pose: Pose) -> Cuboids:
    """A board whose edge runs across the middle of the forearm."""
    elbow, wrist = pose.positions[0, ELBOW], pose.positions[0, WRIST]
    at = 0.45 * elbow + 0.55 * wrist
    half = np.array((0.3, 0.012, 0.012))
    return Cuboids([((0, 0, 0), 0.0, (at - half)[None], (at + half)[None])])


def test_a_forearm_goes_around_an_edge_and_the_hand_stays(reaching):
    pose, leads = reaching
    solid = board_in(pose)
    assert depth(pose, solid)[45] > 0.02
    solved = with_room(pose, leads, [Obstacle(solid)], BUNDLED)
    assert depth(solved, solid)[40:50].max() < 0.0
    for joint in (SHOULDER, WRIST):
        assert solved.positions[:, joint] == pytest.approx(pose.positions[:, joint], abs=1e-6)
    assert np.abs(solved.world[:, WRIST] * pose.world[:, WRIST]).sum(-1).min() > 0.999
    # The other arm, and frames far from those in which it is led, are as they were.
    assert solved.local[:10] == pytest.approx(pose.local[:10], abs=1e-6)
    assert solved.positions[:, ARMS[0][1]] == pytest.approx(pose.positions[:, ARMS[0][1]], abs=1e-6)
    step = np.linalg.norm(np.diff(solved.positions[:, ELBOW], axis=0), axis=-1)
    assert step.max() < 0.04


def test_an_arm_that_has_room_and_one_that_is_not_led_stay(reaching):
    pose, leads = reaching
    far = Cuboids([((0, 0, 0), 0.0, np.array([(3.0, 3, 0)]), np.array([(4.0, 4, 1)]))])
    kept = with_room(pose, leads, [Obstacle(far)], BUNDLED)
    assert np.linalg.norm(kept.positions[:, ELBOW] - pose.positions[:, ELBOW], axis=-1).max() < 0.06
    unled = with_room(pose, [[] for _ in leads], [Obstacle(board_in(pose))], BUNDLED)
    assert unled.positions == pytest.approx(pose.positions)
