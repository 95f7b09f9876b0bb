"""Feet pass what stands on the floor: stands are moved as a whole, ways between them give way."""

from __future__ import annotations

import numpy as np

from core_tests.body.ik.test_clearance import block
from core_tests.body.ik.test_footsteps import blurred, walk
from nsm_core.body.capsules import SPHERES
from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.ik.foot_clearance import FOOT_SPHERES, keep_clear
from nsm_core.body.ik.footsteps import FootGround, footsteps
from nsm_core.body.ik.solver import Pose
from nsm_core.body.tree import HUMAN
from nsm_core.rotations import quat_mul, quat_rotate
from nsm_core.world.scene.terrain import Terrain


def depth(steps, pose, query):
    positions, world = pose.positions.copy(), pose.world.copy()
    positions[:, ANKLES], world[:, ANKLES] = steps.ankles, steps.rotations
    offsets = np.broadcast_to(HUMAN.offsets[TOES], steps.ankles.shape)
    positions[:, TOES] = steps.ankles + quat_rotate(steps.rotations, offsets)
    world[:, TOES] = quat_mul(steps.rotations, pose.local[:, TOES])
    centres, radii = (a[:, FOOT_SPHERES] for a in SPHERES.of(positions, world))
    distance = query.signed_distance(centres.reshape(-1, 3).astype(np.float32), 0.3).reshape(radii.shape)
    return np.maximum(0, radii - distance).max(1)


def test_a_leg_of_a_table_is_passed_and_stands_stay_still():
    hips, local, contacts = walk()
    pose = Pose(HUMAN, hips.astype(np.float64), local.astype(np.float64))
    toes = pose.positions[:, TOES]
    steps = footsteps(
        toes, pose.world[:, ANKLES], blurred(contacts), FootGround(Terrain(), Terrain(), np.zeros(120))
    )
    a, b = steps.runs[0][1]
    at = steps.ankles[a, 0]
    leg = block((at[0] - 0.1, at[1] - 0.08, 0.0), (at[0] - 0.03, at[1] - 0.02, 0.7))
    before = depth(steps, pose, leg)
    for _ in keep_clear(steps, pose, [Obstacle(leg)]):
        pass
    after = depth(steps, pose, leg)
    assert before.max() > 0.025 and after.max() < 0.006
    for side in (0, 1):
        for first, last in steps.runs[side]:
            assert np.ptp(steps.ankles[first:last, side, :2] - at[:2], axis=0).max() < 0.2
    moved = steps.ankles[a:b, 0, :2] - steps.ankles[a, 0, :2]
    flat = np.abs(steps.rotations[a:b, 0] - steps.rotations[a, 0]).max(1) < 1e-3
    assert np.abs(moved[flat]).max() < 1e-3


def test_what_is_far_moves_nothing():
    hips, local, contacts = walk()
    pose = Pose(HUMAN, hips.astype(np.float64), local.astype(np.float64))
    ground = FootGround(Terrain(), Terrain(), np.zeros(120))
    steps = footsteps(pose.positions[:, TOES], pose.world[:, ANKLES], blurred(contacts), ground)
    ankles = steps.ankles.copy()
    for _ in keep_clear(steps, pose, [Obstacle(block((5, 5, 0), (6, 6, 1)))]):
        pass
    assert np.array_equal(ankles, steps.ankles)


def test_an_edge_that_a_heel_hangs_over_does_not_push_the_foot_off():
    hips, local, contacts = walk()
    pose = Pose(HUMAN, hips.astype(np.float64), local.astype(np.float64))
    steps = footsteps(
        pose.positions[:, TOES],
        pose.world[:, ANKLES],
        blurred(contacts),
        FootGround(Terrain(), Terrain(), np.zeros(120)),
    )
    a, b = steps.runs[0][1]
    ankle = steps.ankles[(a + b) // 2, 0]
    slab = block((-1.0, ankle[1] - 1.0, -0.2), (1.0, ankle[1] - 0.01, 0.0))  # it begins before the ankle
    assert depth(steps, pose, slab)[a:b].max() > 0
    planned = steps.ankles.copy()
    for _ in keep_clear(steps, pose, [Obstacle(slab)]):
        pass
    assert np.abs(steps.ankles - planned)[a:b, 0].max() < 0.005
