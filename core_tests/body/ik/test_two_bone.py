"""Two-bone IK against an optimiser, scipy rotations and what a limb must never do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from nsm_core.body.ik.two_bone import (
    chain_frames,
    leg_reach,
    place_limb,
    place_limbs,
    place_wrists,
)
from nsm_core.body.skeleton import ARMS, FEET, INDEX, OFFSETS, J, forward_kinematics
from nsm_core.rotations import quat_from_rotvec, quat_mul, quat_rotate


def random_poses(count: int, seed: int = 0, dtype: type = np.float64) -> tuple[np.ndarray, np.ndarray]:
    """Plausible poses: small turns everywhere, any heading, knees and elbows flexed 0 to 2 rad."""
    rng = np.random.default_rng(seed)
    rotations = quat_from_rotvec(rng.normal(0, 0.25, (count, J, 3)))
    rotations[:, 0] = quat_mul(
        quat_from_rotvec(np.array((0, 0, 1.0)) * rng.uniform(-np.pi, np.pi, (count, 1))), rotations[:, 0]
    )
    for name, axis in (
        ("RightKnee", (1, 0, 0)),
        ("LeftKnee", (1, 0, 0)),
        ("RightElbow", (0, 0, 1)),
        ("LeftElbow", (0, 0, -1)),
    ):
        rotations[:, INDEX[name]] = quat_from_rotvec(np.array(axis) * rng.uniform(0, 2, (count, 1)))
    hips = rng.normal(0, 1, (count, 3)) * (1, 1, 0.05) + (0, 0, 0.9)
    return hips.astype(dtype), rotations.astype(dtype)


def leg_targets(hips: np.ndarray, rotations: np.ndarray, side: int, seed: int = 1) -> np.ndarray:
    """Targets within reach of the hip joint, mostly below it."""
    rng = np.random.default_rng(seed)
    start = chain_frames(hips, rotations, (FEET[side][0],))[0][..., 0, :]
    way = rng.normal(0, 0.5, hips.shape) + (0, 0, -1)
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    return start + way * rng.uniform(0.35, leg_reach(), (len(hips), 1))


def place_ankles(hips: np.ndarray, rotations: np.ndarray, side: int, target: np.ndarray) -> np.ndarray:
    """New rotations with one ankle at a target, the foot turned as it was."""
    return place_limb(hips, rotations, FEET[side][:3], target)


def flexion(positions: np.ndarray, rotations: np.ndarray, chain: tuple, hinge: tuple) -> np.ndarray:
    """Signed sine of the bend about the hinge: positive is the way the joint bends."""
    a, b, c = (positions[:, j] for j in chain[:3])
    normal = np.cross(b - a, c - b)
    axis = quat_rotate(rotations[:, chain[0]], np.broadcast_to(np.array(hinge, dtype=float), a.shape))
    return np.sum(normal * axis, -1) / (np.linalg.norm(b - a, axis=-1) * np.linalg.norm(c - b, axis=-1))


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-9), (np.float32, 1e-5)])
def test_ankle_meets_every_target_within_reach(side, dtype, tolerance):
    hips, rotations = random_poses(500, dtype=dtype)
    target = leg_targets(hips, rotations, side).astype(dtype)
    before = forward_kinematics(hips, rotations)
    new = place_ankles(hips, rotations, side, target)
    positions, world = forward_kinematics(hips, new)
    assert new.dtype == dtype
    assert np.abs(positions[:, FEET[side][2]] - target).max() < tolerance
    assert np.all(flexion(positions, world, FEET[side], (1, 0, 0)) > -1e-6)
    # The foot stays turned as it was, all else keeps its place.
    foot = Rotation.from_quat(np.roll(world[:, FEET[side][2]], -1, -1)).inv() * Rotation.from_quat(
        np.roll(before[1][:, FEET[side][2]], -1, -1)
    )
    assert foot.magnitude().max() < 10 * tolerance
    others = [j for j in range(J) if j not in FEET[side][:3]]
    assert np.array_equal(new[:, others], rotations[:, others])
    assert np.allclose(np.linalg.norm(new, axis=-1), 1, atol=1e-5)


def test_input_is_not_changed():
    hips, rotations = random_poses(3)
    kept = rotations.copy()
    place_ankles(hips, rotations, 0, leg_targets(hips, rotations, 0))
    assert np.array_equal(kept, rotations)


def test_backward_knee_is_mended():
    hips, rotations = random_poses(50)
    rotations[:, INDEX["RightKnee"]] = quat_from_rotvec(np.tile((-0.5, 0.0, 0.0), (50, 1)))
    new = place_ankles(hips, rotations, 0, leg_targets(hips, rotations, 0))
    assert np.all(flexion(*forward_kinematics(hips, new), FEET[0], (1, 0, 0)) > -1e-6)


@pytest.mark.parametrize("side", [0, 1])
def test_arms_reach_and_elbows_bend_the_right_way(side):
    hips, rotations = random_poses(300)
    start = chain_frames(hips, rotations, (ARMS[side][0],))[0][..., 0, :]
    rng = np.random.default_rng(3)
    way = rng.normal(size=(300, 3))
    target = start + way / np.linalg.norm(way, axis=-1, keepdims=True) * rng.uniform(0.2, 0.53, (300, 1))
    positions, world = forward_kinematics(hips, place_wrists(hips, rotations, side, target))
    assert np.abs(positions[:, ARMS[side][2]] - target).max() < 1e-3
    assert np.all(flexion(positions, world, ARMS[side], (0, 0, 1 - 2 * side)) > -1e-6)


def test_own_position_as_target_changes_nothing():
    hips, rotations = random_poses(300)
    positions, world = forward_kinematics(hips, rotations)
    bent = flexion(positions, world, FEET[0], (1, 0, 0)) > 0.15
    new, _ = forward_kinematics(hips, place_ankles(hips, rotations, 0, positions[:, FEET[0][2]]))
    assert np.abs(new - positions)[bent].max() < 1e-9
    assert np.abs(new - positions)[:, FEET[0][2]].max() < 5e-4  # dead straight is given up softly
    assert np.abs(new - positions).max() < 0.04  # a nearly straight knee may settle on its hinge


def test_agrees_with_numeric_optimisation():
    """Of all knees that meet the target, ours is the one that stays in the plane of the bend."""
    hips, rotations = random_poses(6, seed=5)
    target = leg_targets(hips, rotations, 0)
    positions, _ = forward_kinematics(hips, rotations)
    hip, knee, ankle = (positions[:, j] for j in FEET[0][:3])
    placed, _ = forward_kinematics(hips, place_ankles(hips, rotations, 0, target))
    ours, reached = placed[:, FEET[0][1]], placed[:, FEET[0][2]]
    axis = np.cross(ours - hip, reached - ours)
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    a, b = (np.linalg.norm(OFFSETS[j]) for j in FEET[0][1:3])
    for i in range(6):

        def cost(k, i=i):
            lengths = (np.linalg.norm(k - hip[i]) - a) ** 2 + (np.linalg.norm(k - target[i]) - b) ** 2
            return lengths + np.dot(k - hip[i], axis[i]) ** 2

        found = minimize(cost, ours[i] + 0.02, tol=1e-14).x
        assert np.linalg.norm(found - ours[i]) < 1e-4
    swing = [Rotation.align_vectors([t], [e])[0] for t, e in zip(target - hip, ankle - hip, strict=True)]
    normal = np.cross(knee - hip, ankle - knee)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    clear = np.linalg.norm(np.cross(knee - hip, ankle - knee), axis=-1) / (a * b) > 0.15
    # align_vectors of one pair is the shortest arc, so it carries the plane as we do.
    carried = np.array([s.apply(n) for s, n in zip(swing, normal, strict=True)])
    assert np.sum(clear) >= 3
    assert np.abs(carried - axis)[clear].max() < 1e-6


def test_stretching_out_is_smooth():
    """Pulling the target through and past full length moves the knee without a pop."""
    hips = np.tile((0.0, 0, 0.97), (400, 1))
    rotations = np.zeros((400, J, 4))
    rotations[..., 0] = 1
    rotations[:, INDEX["RightKnee"]] = quat_from_rotvec(np.array((0.6, 0, 0)))
    start = chain_frames(hips, rotations, (FEET[0][0],))[0][:, 0]
    pull = np.linspace(0.75, 0.95, 400)
    positions, _ = forward_kinematics(
        hips, place_ankles(hips, rotations, 0, start + pull[:, None] * (0, 0, -1.0))
    )
    span = np.linalg.norm(positions[:, FEET[0][2]] - start, axis=-1)
    assert np.all(np.diff(span) > -1e-9) and span[-1] < 0.835
    bend = np.arccos(np.clip(-positions[:, FEET[0][1], 2] + start[:, 2], 0, 0.42) / 0.42)
    assert np.abs(np.diff(bend)).max() < np.radians(0.5)  # a hard clamp jumps several degrees in such a step
    assert np.abs(span - pull)[pull < 0.99 * 0.835].max() < 1e-9


def test_straight_leg_bends_knee_toward_the_front():
    hips = np.array(((0.0, 0, 0.97),))
    rotations = np.zeros((1, J, 4))
    rotations[..., 0] = 1
    target = np.array(((-0.09, 0.0, 0.25),))
    positions, _ = forward_kinematics(hips, place_ankles(hips, rotations, 0, target))
    assert positions[0, INDEX["RightKnee"], 1] < -0.2  # the front is -Y
    assert abs(positions[0, INDEX["RightKnee"], 0] + 0.09) < 1e-6


def test_far_and_near_targets_stay_finite():
    hips, rotations = random_poses(40)
    start = chain_frames(hips, rotations, (FEET[0][0],))[0][:, 0]
    for target in (start, start + 1e-9, start + (0, 0, -5.0), start + (0, 0, 5.0)):
        new = place_ankles(hips, rotations, 0, target)
        assert np.isfinite(new).all() and np.allclose(np.linalg.norm(new, axis=-1), 1)


def test_the_rotation_of_the_end_is_met():
    hips, rotations = random_poses(100)
    foot, ankle = (
        quat_from_rotvec(np.random.default_rng(2).normal(0, 0.3, (100, 3))),
        leg_targets(hips, rotations, 1),
    )
    positions, world = forward_kinematics(hips, place_limb(hips, rotations, FEET[1][:3], ankle, foot))
    assert np.abs(positions[:, FEET[1][2]] - ankle).max() < 1e-6
    assert np.allclose(np.abs(np.sum(world[:, FEET[1][2]] * foot, -1)), 1)


def test_both_legs_at_once_equal_one_after_the_other():
    hips, rotations = random_poses(20)
    targets = np.stack([leg_targets(hips, rotations, s) for s in (0, 1)], axis=-2)
    both = place_limbs(hips, rotations, (FEET[0][:3], FEET[1][:3]), targets)
    single = place_ankles(hips, place_ankles(hips, rotations, 0, targets[:, 0]), 1, targets[:, 1])
    assert np.allclose(both, single)
    assert np.allclose(both[3], place_limbs(hips[3], rotations[3], (FEET[0][:3], FEET[1][:3]), targets[3]))


def test_noise_of_a_straight_leg_is_not_magnified():
    """A nearly straight leg whose tiny bend points anywhere bends, when told to, about its hinge."""
    hips = np.tile((0.0, 0, 0.97), (50, 1))
    local = np.zeros((50, J, 4))
    local[..., 0] = 1
    turn = np.random.default_rng(0).normal(0, 1, (50, 3)) * (0.02, 0.02, 0) + (0.06, 0, 0)
    local[:, INDEX["RightKnee"]] = quat_from_rotvec(turn)
    positions, _ = forward_kinematics(
        hips, place_ankles(hips, local, 0, np.tile((-0.09, 0.0, 0.25), (50, 1)))
    )
    assert np.ptp(positions[:, INDEX["RightKnee"], 0]) < 0.06  # the noise itself spreads over half a metre


def test_arms_of_one_pose_and_of_many_are_placed_alike():
    """In numbers and in arrays, stretched, folded and turned right about."""
    hips, rotations = random_poses(40, seed=6)
    starts = chain_frames(hips, rotations, (ARMS[0][0], ARMS[1][0]))[0]
    targets = starts + np.random.default_rng(7).normal(0, 0.4, starts.shape)
    targets[0] = starts[0]
    many = place_limbs(hips, rotations, ARMS, targets)
    assert np.isfinite(many).all()
    for n in range(40):
        assert np.allclose(many[n], place_limbs(hips[n], rotations[n], ARMS, targets[n]), atol=1e-9)
