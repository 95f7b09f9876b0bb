"""One step of a character: goal-centric blending, bone lengths, switches, phase and history."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from captures import walk

from nsm_core.body.skeleton import ARMS, HIPS, OFFSETS, PARENTS, forward_kinematics
from nsm_core.model.features.codec import build_targets, read_outputs
from nsm_core.model.features.layout import OUTPUT
from nsm_core.model.features.rollout_step import Blending, advance, goal_centric_weights, restore_bone_lengths
from nsm_core.model.features.state import KEY_STEP, State, standing_state
from nsm_core.rotations import quat_to_matrix

DT = 1 / 30


@pytest.fixture
def states() -> State:
    """Four characters at four moments of a walk, with goals of their own."""
    hips, local = walk(3.0, 0.6, 3.2)
    positions, rotations = forward_kinematics(hips, local)
    matrices, at = quat_to_matrix(rotations), np.array((40, 60, 75, 100))
    root = np.concatenate((positions[at, HIPS, :2], np.array((0.05, 0.2, 0.3, 0.55))[:, None]), axis=1)
    s = standing_state(positions[at], -matrices[at][..., 1], matrices[at][..., 2], root)
    rng = np.random.default_rng(5)
    s.joint_velocity = ((positions[at] - positions[at - 1]) / DT).astype(np.float32)
    s.root_past = s.root_past + rng.normal(0, 0.3, s.root_past.shape).astype(np.float32)
    s.root_future = s.root_future + rng.normal(0, 0.3, s.root_future.shape).astype(np.float32)
    s.goal_position = s.goal_position + rng.normal(0, 0.6, (4, 1, 3)).astype(np.float32)
    s.phase_past = rng.random(s.phase_past.shape).astype(np.float32)
    return s


def following_of(s: State) -> State:
    """A plausible next frame of ``s``: everything moves by a few centimetres."""
    rng = np.random.default_rng(6)

    def near(a, size):
        return (a + rng.normal(0, size, a.shape)).astype(np.float32)

    phase = (s.phase_past[:, -1:] + np.array((0.03,)) + 0.15 * np.arange(7)) % 1
    return replace(
        s,
        joint_position=near(s.joint_position, 0.01),
        root_past=np.concatenate((s.root_past[:, 1:], near(s.root_past[:, -1:], 0.03)), axis=1),
        root_future=near(s.root_future, 0.03),
        phase_past=np.concatenate((s.phase_past[:, 1:], phase[:, :1].astype(np.float32)), axis=1),
        phase_future=phase[:, 1:].astype(np.float32),
    )


def outputs_of(s: State) -> np.ndarray:
    return build_targets(s, following_of(s), np.ones((4, 5), np.float32))


def test_weights_of_the_goals_view():
    distance = np.array([[0.0] * 6, [0.5] * 6, [1.0] * 6, [4.0] * 6])
    w = goal_centric_weights(distance)
    for b, d in enumerate(distance[:, 0]):
        np.testing.assert_allclose(w[b], [(k / 7) ** (d * d) for k in range(1, 7)], rtol=1e-5)
    np.testing.assert_array_equal(w[0], 1)  # at the goal its view wins
    assert (np.diff(w[1:], axis=1) > 0).all() and (np.diff(w, axis=0) < 0).all() and w[3].max() < 0.1


def test_bones_keep_their_lengths_whatever_is_predicted(states):
    noisy = outputs_of(states)
    noisy[:, OUTPUT.slices["joint_position"]] += (
        np.random.default_rng(0).normal(0, 0.05, (4, 69)).astype(np.float32)
    )
    stepped = advance(states, read_outputs(noisy, states))
    bones = stepped.joint_position[:, 1:] - stepped.joint_position[:, list(PARENTS[1:])]
    np.testing.assert_allclose(
        np.linalg.norm(bones, axis=-1), np.tile(np.linalg.norm(OFFSETS[1:], axis=1), (4, 1)), atol=1e-5
    )


def test_a_stretched_limb_is_put_right_along_itself():
    positions, _ = forward_kinematics(*walk(1.0, 0.3, 1.2))
    np.testing.assert_allclose(restore_bone_lengths(positions), positions, atol=1e-6)
    shoulder, elbow, wrist = ARMS[0]
    stretched = positions.copy()
    for j in (elbow, wrist):  # the upper arm turns out 20 % too long, the forearm goes with it
        stretched[:, j] += 0.2 * (positions[:, elbow] - positions[:, shoulder])
    before = stretched.copy()
    restored = restore_bone_lengths(stretched)
    np.testing.assert_array_equal(stretched, before)
    np.testing.assert_allclose(restored[:, elbow], positions[:, elbow], atol=1e-6)
    others = [j for j in range(23) if j not in (elbow, wrist)]
    np.testing.assert_allclose(restored[:, others], positions[:, others], atol=1e-6)
    assert np.linalg.norm(restored[:, wrist] - positions[:, wrist], axis=-1).max() < 0.06


def test_position_is_half_predicted_and_half_integrated(states):
    predicted = read_outputs(outputs_of(states), states)
    predicted.joint_position[:, HIPS] = states.joint_position[:, HIPS] + (0.0, 0.2, 0.0)
    predicted.joint_velocity[:, HIPS] = (3.0, 0.0, 0.0)
    hips = advance(states, predicted).joint_position[:, HIPS]
    np.testing.assert_allclose(
        hips - states.joint_position[:, HIPS], np.tile((0.05, 0.1, 0.0), (4, 1)), atol=1e-5
    )


def test_trajectory_is_blended_towards_the_goals_view(states):
    predicted = read_outputs(outputs_of(states), states)
    predicted.root_goalward = predicted.root + np.array((0.4, -0.3, 0.5), np.float32)
    on, off = advance(states, predicted), advance(states, predicted, Blending(goal_centric=False))
    np.testing.assert_allclose(off.root_future, predicted.root[:, 1:], atol=1e-6)
    distance = np.linalg.norm(predicted.root[:, 1:, :2] - states.goal_position[:, 7:, :2], axis=-1)
    w = ((np.arange(1, 7) / 7) ** distance**2)[..., None]
    assert 0.01 < w.min() and w.max() < 1
    np.testing.assert_allclose(
        on.root_future, predicted.root[:, 1:] + w * np.array((0.4, -0.3, 0.5)), atol=1e-5
    )
    np.testing.assert_allclose(on.root, predicted.root[:, 0], atol=1e-6)  # the pivot is never blended
    predicted.root_goalward = predicted.root + np.array((0, 0, 2 * np.pi), np.float32)
    turned = advance(states, predicted).root_future[..., 2]
    np.testing.assert_allclose(turned, predicted.root[:, 1:, 2], atol=1e-5)  # a whole turn is no turn


def test_velocity_is_led_by_the_pose_seen_from_ahead(states):
    predicted = read_outputs(outputs_of(states), states)
    predicted.future_joint_position = predicted.future_joint_position + np.float32(0.1)
    on, off = advance(states, predicted), advance(states, predicted, Blending(future_pose=False))
    np.testing.assert_array_equal(off.joint_velocity, predicted.joint_velocity)
    # (1 - dt) v + dt (R' j - j) / dt, section 4.2
    expected = (1 - DT) * predicted.joint_velocity + DT * (
        predicted.future_joint_position - states.joint_position
    ) / DT
    np.testing.assert_allclose(on.joint_velocity, expected, atol=1e-5)
    np.testing.assert_array_equal(on.joint_position, off.joint_position)


def test_phase_moves_on_and_wraps(states):
    states.phase_past[:, -1] = (0.99, 0.5, 0.0, 0.97)
    y = outputs_of(states)
    OUTPUT.get(y, "phase_update")[:] = 0.04 + 0.2 * np.arange(7)
    stepped = advance(states, read_outputs(y, states))
    np.testing.assert_allclose(stepped.phase_past[:, -1], (0.03, 0.54, 0.04, 0.01), atol=1e-6)
    np.testing.assert_allclose(stepped.phase_future[0], (0.03 + 0.2 * np.arange(1, 7)) % 1, atol=1e-6)
    assert (stepped.phase_keys() >= 0).all() and (stepped.phase_keys() < 1).all()


def test_history_shifts_by_one_frame(states):
    before = replace(states, root_past=states.root_past.copy())
    predicted = read_outputs(outputs_of(states), states)
    stepped = advance(states, predicted)
    np.testing.assert_array_equal(states.root_past, before.root_past)
    for name, newest in (("root_past", predicted.root[:, 0]), ("style_past", predicted.style[:, 0])):
        past = getattr(stepped, name)
        np.testing.assert_array_equal(past[:, :-1], getattr(states, name)[:, 1:])
        np.testing.assert_allclose(past[:, -1], newest, atol=1e-6)
    np.testing.assert_array_equal(stepped.phase_past[:, :-1], states.phase_past[:, 1:])
    np.testing.assert_array_equal(stepped.root_keys()[:, :6], stepped.root_past[:, :30:KEY_STEP])
    assert stepped.goal_position is states.goal_position


def test_rows_are_stepped_independently(states):
    together = advance(states, read_outputs(outputs_of(states), states))
    alone = State(*(getattr(states, field.name)[[2]] for field in fields(State)))
    stepped = advance(alone, read_outputs(outputs_of(states)[2:3], alone))
    np.testing.assert_allclose(stepped.joint_position[0], together.joint_position[2], atol=1e-6)
    np.testing.assert_allclose(stepped.root_future[0], together.root_future[2], atol=1e-6)
    states.assign(np.array([0]), alone)
    np.testing.assert_array_equal(states.joint_position[0], states.joint_position[2])


def test_a_standing_character_stands():
    positions, rotations = forward_kinematics(*walk(1.0, 0, 1.2))
    m = quat_to_matrix(rotations)
    s = standing_state(positions[:2], -m[:2, ..., 1], m[:2, ..., 2], np.array(((0, 0, 0), (1.0, 2.0, 3.0))))
    assert (
        s.root_keys().shape == (2, 13, 3)
        and (np.ptp(s.root_keys(), axis=1) == 0).all()
        and not s.joint_velocity.any()
    )
    np.testing.assert_array_equal(s.style_keys().sum(-1), 1)
    np.testing.assert_array_equal(s.goal_position[..., :2], s.root_keys()[..., :2])
    steps = np.diff(s.phase_keys(), axis=1)
    np.testing.assert_allclose((steps - np.round(steps)), 5 / 30, atol=1e-5)
