"""Feet stand from landing to lift-off without sliding, are set anew where a body drifts, and clear
the ground.
"""

from __future__ import annotations

import numpy as np
import pytest
from walks import synthetic_walk

from nsm_core.body.contacts import ANKLES, TOE_OFFSET, TOES, Sole
from nsm_core.body.ik.footsteps import CLEARANCE, EDGE, FootGround, footsteps
from nsm_core.body.skeleton import TOE_HEIGHT, forward_kinematics
from nsm_core.rotations import quat_rotate
from nsm_core.world.scene.terrain import HeightMap, Terrain

FPS = 30


def blurred(contacts):
    """Labels (T, 2) as a network's are: blurred over five frames."""
    padded = np.pad(contacts.astype(float), ((2, 2), (0, 0)), mode="edge")
    return np.mean([padded[i : i + len(contacts)] for i in range(5)], axis=0)


def slid(hips, drift=0.3):
    """The same walk carried over the floor: ``drift`` m/s to and fro across the way."""
    hips = hips.copy()
    hips[:, 0] += drift / 1.5 * np.sin(1.5 * np.arange(len(hips)) / FPS)
    return hips


def planted(hips, local, labels, terrain=None):
    positions, world = forward_kinematics(hips.astype(np.float64), local.astype(np.float64))
    ground = FootGround(terrain or Terrain(), Terrain(), np.zeros(len(hips)))
    steps = footsteps(positions[:, TOES], world[:, ANKLES], labels, ground)
    return steps, steps.ankles + quat_rotate(steps.rotations, TOE_OFFSET), positions[:, TOES]


def walk(frames=120):
    hips, local, contacts = synthetic_walk(frames)
    return hips, local, contacts


def test_planted_feet_do_not_slide_at_all():
    hips, local, contacts = walk()
    steps, toes, before = planted(slid(hips), local, blurred(contacts))
    speed = np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1) * FPS
    both = steps.planted[1:] & steps.planted[:-1]
    was = np.linalg.norm(np.diff(before[..., :2], axis=0), axis=-1) * FPS
    assert was[both].mean() > 0.1 and speed[both].max() < 1e-6
    assert 0.8 < np.mean(steps.planted == contacts)


def test_a_clean_walk_is_left_alone():
    hips, local, contacts = walk()
    steps, toes, before = planted(hips, local, blurred(contacts))
    assert np.abs(toes - before)[..., :2].max() < 0.06


def test_corrections_leave_and_reach_stands_without_a_jolt():
    hips, local, contacts = walk()
    steps, toes, before = planted(slid(hips), local, blurred(contacts))

    def jolt(p):
        return np.abs(np.diff(p[..., :2], n=2, axis=0)).max()

    assert jolt(toes) < 1.6 * jolt(before) + 0.01


def test_a_body_that_drifts_sets_its_feet_anew_one_after_the_other():
    hips, local, contacts = walk(150)
    hips, local = np.repeat(hips[:1], 150, 0), np.repeat(local[:1], 150, 0)
    hips[:, 0] += np.linspace(0, 0.5, 150)
    steps, toes, before = planted(hips, local, np.ones((150, 2)))
    assert np.abs(toes - before)[..., :2].max() < 0.16  # nobody is left behind
    assert all(len(runs) >= 3 for runs in steps.runs)
    assert steps.planted.any(1).all()  # never both in the air
    lifted = toes[..., 2].max() - toes[..., 2].min()
    assert lifted > 0.02


def test_feet_come_out_of_the_floor_and_swing_over_it():
    hips, local, contacts = walk()
    steps, toes, _ = planted(hips - (0, 0, 0.05), local, blurred(contacts))
    assert Sole().depth(toes, steps.rotations).max() < 0.006
    pace = np.linalg.norm(np.gradient(toes[..., :2], axis=0), axis=-1) * FPS
    middle = ~steps.planted & (pace > 0.6)
    assert middle.any() and np.median(toes[middle][:, 2]) > TOE_HEIGHT + 0.6 * CLEARANCE


def step_at(y, height=0.2, deep=3.0):
    """FootGround that is ``height`` high from ``y`` on, in the direction of the walk (-Y)."""
    cells = np.full((200, int(deep / 0.02)), height)
    return Terrain([HeightMap(np.array((-2.0, y - deep)), 0.0, cells)])


@pytest.mark.parametrize("height", [0.15, 0.3])
def test_nothing_of_a_foot_is_in_a_step_that_is_walked_up(height):
    hips, local, contacts = walk()
    edge = float(hips[60, 1])
    terrain = step_at(edge, height)
    raised = hips.copy()  # as a network would climb, too low and too late
    raised[:, 2] += height * np.clip((np.arange(120) - 62) / 18, 0, 1)
    steps, toes, _ = planted(raised, local, blurred(contacts), terrain)
    stands = steps.planted
    under = terrain.height(toes[..., :2].reshape(-1, 2)).reshape(stands.shape)
    assert np.abs((toes[..., 2] - TOE_HEIGHT - under)[stands]).max() < 0.02
    swinging = ~stands
    assert (under - (toes[..., 2] - TOE_HEIGHT))[swinging].max() < EDGE + 0.02


def test_a_stand_beside_a_riser_keeps_the_whole_foot_off_it():
    hips, local, contacts = walk(40)
    hips, local = np.repeat(hips[:1], 40, 0), np.repeat(local[:1], 40, 0)
    toe = forward_kinematics(hips, local)[0][0, TOES[0]]
    terrain = step_at(float(toe[1]) - 0.05)  # the tip would be 2.5 cm in it
    steps, toes, _ = planted(hips, local, np.ones((40, 2)), terrain)
    assert toes[:, 0, 1].min() > float(toe[1]) + 0.02
    assert np.abs(toes[:, 0, 2] - TOE_HEIGHT).max() < 0.01


def test_a_heel_that_hangs_over_an_edge_is_taken_onto_the_step():
    hips, local, contacts = walk(40)
    hips, local = np.repeat(hips[:1], 40, 0) + (0, 0, 0.2), np.repeat(local[:1], 40, 0)
    toe = forward_kinematics(hips, local)[0][0, TOES[0]]
    edge = float(toe[1]) + 0.06  # the walk goes to -Y: 6 cm of the foot behind its ball are on the step
    steps, toes, _ = planted(hips, local, np.ones((40, 2)), step_at(edge))
    assert 0.02 < float(toe[1]) - toes[:, 0, 1].max() < 0.1
    assert steps.ankles[:, 0, 1].max() < edge + 0.01
    assert np.abs(toes[:, 0, 2] - 0.2 - TOE_HEIGHT).max() < 0.01
