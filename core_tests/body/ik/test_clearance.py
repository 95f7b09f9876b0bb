"""A body keeps out of solids: stands still beside them, leans off them, and eases in before and out after."""

from __future__ import annotations

import numpy as np

from core_tests.body.ik.test_solver import T, pinned, standing
from nsm_core.body.capsules import SPHERES, Body, penetration_depths
from nsm_core.body.ik.clearance import Clearance, Obstacle
from nsm_core.body.ik.foot_clearance import FOOT_SPHERES
from nsm_core.body.ik.solver import solved
from nsm_core.body.ik.stiffness import stiffness
from nsm_core.body.near_spheres import near_spheres
from nsm_core.world.geometry.distance import Cuboids


def block(low, high, position=(0.0, 0.0, 0.0)):
    return Cuboids([(position, 0.0, [low], [high])])


BOARD = block((-0.5, -0.6, 0.9), (0.5, -0.09, 1.3))  # before the chest, 3 cm in it


def test_a_trunk_leans_off_a_board():
    pose = standing()
    before = penetration_depths(pose.hips, pose.local, BOARD)
    done = solved(pose, [*pinned(pose), Clearance([Obstacle(BOARD)], FOOT_SPHERES)], stiffness())
    after = penetration_depths(done.hips, done.local, BOARD)
    assert before.min() > 0.02 and after.max() < 0.005
    assert np.linalg.norm(done.hips - pose.hips, axis=1).max() < 0.15


def test_what_touches_nothing_stays():
    pose = standing()
    far = block((2.0, 2.0, 0), (3.0, 3.0, 1.0))
    done = solved(pose, [Clearance([Obstacle(far)], FOOT_SPHERES)], stiffness())
    assert np.allclose(done.local, pose.local) and np.allclose(done.hips, pose.hips)


def test_a_body_gives_way_before_a_thing_comes_and_after_it_has_gone():
    pose = standing()
    poses = np.zeros((T, 4))
    poses[:, 1] = -1.0
    poses[25:35, 1] = 0.0  # for ten frames the board is there
    solid = Obstacle(BOARD, poses)
    done = solved(pose, [*pinned(pose), Clearance([solid], FOOT_SPHERES)], stiffness())
    moved = np.linalg.norm(done.positions[:, 4] - pose.positions[:, 4], axis=1)  # the upper chest
    assert moved[24] > 0.005 and moved[36] > 0.005 and moved[5] < 0.004
    assert np.abs(np.diff(moved)).max() < 0.02
    body = Body.of(done.hips[25:35], done.local[25:35])
    distance = BOARD.signed_distance(body.centres.reshape(-1, 3).astype(np.float32), 0.3)
    assert (body.radii - distance.reshape(body.radii.shape)).max() < 0.01


def test_what_holds_a_thing_may_touch_it():
    pose = standing()
    hand = SPHERES.hand == 0
    centres, _ = SPHERES.of(pose.positions, pose.world)
    middle = centres[0, hand].mean(0)
    box = block(middle - 0.05, middle + 0.05)
    free = np.zeros((T, len(SPHERES.radii)))
    free[:, hand | (SPHERES.forearm == 0)] = 0.3
    kept = solved(pose, [Clearance([Obstacle(box, None, free)], FOOT_SPHERES)], stiffness())
    away = solved(pose, [Clearance([Obstacle(box)], FOOT_SPHERES)], stiffness())
    assert np.allclose(kept.local, pose.local)
    assert np.linalg.norm(away.positions[:, 10] - pose.positions[:, 10], axis=1).min() > 0.02


def test_nobody_leaves_a_wall_through_the_floor():
    pose = standing()
    wall = block((-0.5, -0.04, 0.0), (0.5, 0.04, 0.3))  # the shins stand in it, near its underside
    done = solved(pose, [Clearance([Obstacle(wall)], FOOT_SPHERES)], stiffness())
    assert (done.hips[:, 2] - pose.hips[:, 2]).min() > -0.05


def test_coarse_to_fine_finds_the_spheres_that_are_near():
    pose = standing(5)
    centres, radii = SPHERES.of(pose.positions, pose.world)
    frames, spheres = near_spheres(Obstacle(BOARD).distance, centres, radii, SPHERES, 0.05)
    distance = BOARD.signed_distance(centres.reshape(-1, 3).astype(np.float32), 1.0).reshape(radii.shape)
    expected = set(zip(*np.nonzero(distance < radii + 0.05), strict=True))
    assert expected and set(zip(frames.tolist(), spheres.tolist(), strict=True)) == expected
