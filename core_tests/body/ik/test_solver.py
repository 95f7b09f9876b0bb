"""One solver for whole takes: tasks are met with the least change, smoothly, for any skeleton."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.contacts import ANKLES
from nsm_core.body.ik.solver import Pose, Stiffness, least_step, solved
from nsm_core.body.ik.stiffness import stiffness
from nsm_core.body.ik.tasks import PointTask, TurnTask
from nsm_core.body.skeleton import ARMS, HIPS, INDEX, JOINTS, OFFSETS, forward_kinematics
from nsm_core.body.tree import HUMAN, Tree
from nsm_core.rotations import quat_conjugate, quat_from_rotvec, quat_mul, quat_to_rotvec

T = 60
RNG = np.random.default_rng(5)


def standing(frames: int = T) -> Pose:
    """A body that stands with slightly bent knees and elbows and sways a little."""
    local = np.zeros((frames, len(JOINTS), 4))
    local[..., 0] = 1
    for side, sign in (("Right", -1), ("Left", 1)):
        local[:, INDEX[f"{side}Hip"]] = quat_from_rotvec(np.array((-0.25, 0, 0)))
        local[:, INDEX[f"{side}Knee"]] = quat_from_rotvec(np.array((0.5, 0, 0)))
        local[:, INDEX[f"{side}Ankle"]] = quat_from_rotvec(np.array((-0.25, 0, 0)))
        local[:, INDEX[f"{side}Shoulder"]] = quat_from_rotvec(np.array((0, sign * 1.2, 0)))
        local[:, INDEX[f"{side}Elbow"]] = quat_from_rotvec(np.array((0, 0, -sign * 0.6)))
    sway = 0.01 * np.sin(np.arange(frames) / 8)
    hips = np.stack((sway, 0 * sway, 0.93 + 0.3 * sway), axis=1)
    return Pose(HUMAN, hips, local)


def pinned(pose: Pose) -> list:
    """Tasks that keep the feet where they are."""
    tight = np.full(len(pose.hips), 0.001)
    return [
        task
        for ankle in ANKLES
        for task in (
            PointTask(ankle, pose.positions[:1, ankle].repeat(len(pose.hips), 0), tight),
            TurnTask(ankle, pose.world[:1, ankle].repeat(len(pose.hips), 0), 10 * tight),
        )
    ]


def test_the_tree_of_a_person_is_the_skeleton():
    local = quat_from_rotvec(RNG.normal(0, 0.4, (7, len(JOINTS), 3)))
    hips = RNG.normal(0, 1, (7, 3))
    ours, theirs = HUMAN.forward(hips, local), forward_kinematics(hips, local)
    assert np.allclose(ours[0], theirs[0], atol=1e-6) and np.allclose(ours[1], theirs[1], atol=1e-6)


def test_a_tree_whose_joints_come_before_their_parents_is_refused():
    with pytest.raises(ValueError, match="comes after its own"):
        Tree((-1, 2, 0), np.zeros((3, 3)))
    with pytest.raises(ValueError, match="offsets"):
        Tree((-1, 0), np.zeros((3, 3)))


def test_jacobians_are_the_derivatives_of_forward_kinematics():
    local = quat_from_rotvec(RNG.normal(0, 0.4, (4, len(JOINTS), 3)))
    pose = Pose(HUMAN, RNG.normal(0, 1, (4, 3)), local)
    step = RNG.normal(0, 1e-5, (4, 3 + 3 * len(JOINTS)))
    moved = pose.moved(step)
    wrist = INDEX["LeftWrist"]
    point = PointTask(wrist, np.zeros((4, 3)), np.ones(4), (0.1, 0.02, -0.03))
    turn = TurnTask(wrist, np.tile((1.0, 0, 0, 0), (4, 1)), np.ones(4))
    rows, after = point.rows(pose, slice(0, 4)), point.rows(moved, slice(0, 4))
    assert np.allclose(rows.error - after.error, np.einsum("trk,tk->tr", rows.jacobian, step), atol=1e-8)
    gap = quat_to_rotvec(quat_mul(moved.world[:, wrist], quat_conjugate(pose.world[:, wrist])))
    told = np.einsum("trk,tk->tr", turn.rows(pose, slice(0, 4)).jacobian, step)
    assert np.allclose(gap, told, atol=1e-8)


def test_hands_reach_and_feet_stay():
    pose = standing()
    wrist = ARMS[1][2]
    ease = np.clip((np.arange(T) - 15) / 20, 0, 1)
    ease = ease**2 * (3 - 2 * ease)
    target = pose.positions[:, wrist] + ease[:, None] * np.array((-0.15, -0.35, 0.1))
    hold = PointTask(wrist, target, np.full(T, 0.002))
    done = solved(pose, [*pinned(pose), hold], stiffness())
    assert np.linalg.norm(done.positions[:, wrist] - target, axis=1).max() < 0.004
    assert np.linalg.norm(done.positions[:, ANKLES] - pose.positions[:1, ANKLES], axis=2).max() < 0.003
    assert np.abs(done.hips[:10] - pose.hips[:10]).max() < 0.01  # nothing is asked there


def test_what_is_out_of_an_arms_reach_the_trunk_leans_to():
    pose = standing()
    wrist, shoulder = ARMS[0][2], ARMS[0][0]
    arm = np.linalg.norm(OFFSETS[list(ARMS[0][1:])], axis=1).sum()
    target = pose.positions[:, shoulder] + np.array((0.0, -(arm + 0.12), -0.1))
    done = solved(pose, [*pinned(pose), PointTask(wrist, target, np.full(T, 0.002))], stiffness())
    assert np.linalg.norm(done.positions[:, wrist] - target, axis=1).max() < 0.03
    lean = done.positions[:, shoulder] - pose.positions[:, shoulder]
    assert lean[:, 1].max() < -0.08  # a character faces -Y


def test_a_wish_of_one_frame_comes_and_goes_with_its_neighbours():
    pose = standing()
    deviation = np.full(T, np.inf)
    deviation[30] = 0.002
    target = np.repeat(pose.hips[30:31] + np.array((0.0, 0.0, -0.08)), T, 0)
    done = solved(pose, [*pinned(pose), PointTask(HIPS, target, deviation)], stiffness())
    moved = (done.hips - pose.hips)[:, 2]
    assert moved[30] < -0.03 and abs(moved[10]) < 0.005
    assert np.abs(np.diff(moved)).max() < 0.02  # no jump within a frame
    assert np.abs(np.diff(moved, n=2)).max() < 0.025


def test_knees_bend_about_their_hinges():
    pose = standing()
    target = pose.hips + np.array((0.0, 0.0, -0.12))
    done = solved(pose, [*pinned(pose), PointTask(HIPS, target, np.full(T, 0.002))], stiffness())
    for knee in (INDEX["RightKnee"], INDEX["LeftKnee"]):
        turn = quat_to_rotvec(quat_mul(quat_conjugate(pose.local[:, knee]), done.local[:, knee]))
        assert turn[:, 0].min() > 0.2 and np.abs(turn[:, 1:]).max() < 0.12


def test_a_step_takes_the_stiffness_of_joints():
    pose = standing(4)
    task = PointTask(ARMS[0][2], pose.positions[:, ARMS[0][2]] + np.array((0.02, 0, 0)), np.full(4, 0.001))
    rows = [task.rows(pose, slice(0, 4))]
    free = least_step(pose, rows, Stiffness(np.full(3, 1.0), np.full(23, 1e-4), {}))
    stiff = least_step(pose, rows, Stiffness(np.full(3, 1e-4), np.full(23, 1.0), {}))
    assert np.allclose(free[:, 0], 0.02, atol=1e-3) and np.abs(stiff[:, :3]).max() < 1e-4


def test_other_skeletons_are_solved_as_well():
    chain = Tree((-1, 0, 1, 2, 3), np.array([(0, 0, 1.0)] + [(0, 0, 0.3)] * 4))
    local = np.zeros((30, 5, 4))
    local[..., 0] = 1
    local[:, 1] = quat_from_rotvec(np.array((0.3, 0, 0)))
    pose = Pose(chain, np.zeros((30, 3)), local)
    target = pose.positions[:, 4] + np.array((0.1, 0.2, -0.1))
    fixed = Stiffness(np.full(3, 1e-4), np.full(5, 0.5), {})
    done = solved(pose, [PointTask(4, target, np.full(30, 0.001))], fixed)
    assert np.linalg.norm(done.positions[:, 4] - target, axis=1).max() < 0.003
    assert np.abs(done.hips).max() < 1e-3
