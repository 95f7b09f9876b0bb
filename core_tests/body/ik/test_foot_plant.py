"""Feet stay where they land, sit still on the floor, and hips reach the seat, over takes and frame by
frame.
"""

from __future__ import annotations

import numpy as np
import pytest
from walks import LEGS, seated_pose, synthetic_walk

from nsm_core.body.contacts import ANKLES, TOES, detect_foot_contacts, sole_depth
from nsm_core.body.ik.foot_lock import lock_feet
from nsm_core.body.ik.foot_plant import HIP_PLAY, ContactIK
from nsm_core.body.ik.planted_foot import CLEARANCE
from nsm_core.body.skeleton import TOE_HEIGHT, J, forward_kinematics
from nsm_core.rotations import heading_quat, quat_mul, quat_rotate, wrap_angle


def toe_speed(hips: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Horizontal speed (T - 1, 2) of the toe joints, m/s."""
    positions, _ = forward_kinematics(hips, local)
    return np.linalg.norm(np.diff(positions[:, TOES, :2], axis=0), axis=-1) * 30


def slid(hips: np.ndarray, drift: float = 0.3) -> np.ndarray:
    """The same walk carried over the floor: ``drift`` m/s to and fro across the way."""
    hips = hips.copy()
    hips[:, 0] += drift / 1.5 * np.sin(1.5 * np.arange(len(hips)) / 30)
    return hips


def run_frames(hips, local, labels, **options):
    ik = ContactIK()
    frames = [ik.apply(h, q, c, **options) for h, q, c in zip(hips, local, labels, strict=True)]
    return np.array([f[0] for f in frames]), np.array([f[1] for f in frames])


def labels_of(contacts: np.ndarray, hip: float = 0.0) -> np.ndarray:
    """Five labels a frame, the feet's blurred over five frames as a network's are."""
    out = np.zeros((len(contacts), 5))
    out[:, 0] = hip
    padded = np.pad(contacts.astype(float), ((2, 2), (0, 0)), mode="edge")
    out[:, 3:] = np.mean([padded[i : i + len(contacts)] for i in range(5)], axis=0)
    return out


def knee_sines(hips, local):
    positions, rotations = forward_kinematics(hips, local)
    sines = []
    for a, b, c in LEGS:
        normal = np.cross(positions[:, b] - positions[:, a], positions[:, c] - positions[:, b])
        sines.append(np.sum(normal * quat_rotate(rotations[:, a], np.tile((1.0, 0, 0), (len(hips), 1))), -1))
    return np.array(sines)


def test_contacts_of_a_known_walk_are_found():
    hips, local, truth = synthetic_walk()
    positions, _ = forward_kinematics(hips, local)
    found = detect_foot_contacts(positions)
    assert found.shape == truth.shape and found.dtype == bool
    assert np.mean(found == truth) > 0.9
    assert not found[~truth & (positions[:, TOES, 2] > 0.06)].any()


def test_flicker_is_voted_away():
    hips, local, _ = synthetic_walk(40, speed=0.0)
    local[:] = local[:1]
    hips[:] = hips[:1]
    positions, _ = forward_kinematics(hips, local)
    positions[20, TOES[0], 2] += 0.1
    assert detect_foot_contacts(positions).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_whole_take_stops_sliding(dtype):
    hips, local, contacts = synthetic_walk()
    moved = slid(hips).astype(dtype)
    before = toe_speed(moved, local)
    standing = contacts[1:] & contacts[:-1]
    new_hips, new_local = lock_feet(moved, local.astype(dtype), contacts)
    after = toe_speed(new_hips, new_local)
    assert new_local.dtype == dtype and new_hips.dtype == dtype
    assert before[standing].mean() > 0.1 and after[standing].mean() < 0.003 and after[standing].max() < 0.03
    assert np.all(knee_sines(new_hips, new_local) > -1e-6)
    assert np.array_equal(new_hips[:, :2], moved[:, :2]) and np.all(moved[:, 2] - new_hips[:, 2] < 0.081)
    upper = [j for j in range(J) if j not in LEGS[0] + LEGS[1]]
    assert np.array_equal(new_local[:, upper], local[:, upper].astype(dtype))

    # No pop where the correction fades: the legs accelerate little more than before.
    def jolt(h, q):
        return np.abs(np.diff(forward_kinematics(h, q)[0][:, TOES], n=2, axis=0)).max()

    assert jolt(new_hips, new_local) < 1.5 * jolt(moved, local) + 0.005


def test_clean_walk_is_left_alone():
    hips, local, contacts = synthetic_walk()
    new_hips, new_local = lock_feet(hips, local, contacts)
    old, new = forward_kinematics(hips, local)[0], forward_kinematics(new_hips, new_local)[0]
    assert np.abs(old - new).max() < 0.01


@pytest.mark.parametrize("place", ["first", "last"])
def test_the_place_held_can_be_chosen(place):
    hips, local, contacts = synthetic_walk(15)
    contacts[:] = (True, False)
    moved = hips + np.linspace(0, 0.06, 15)[:, None] * (1.0, 0, 0)
    toe = forward_kinematics(moved, local)[0][:, TOES[0], :2]
    held = forward_kinematics(*lock_feet(moved, local, contacts, place=place))[0][:, TOES[0], :2]
    assert np.abs(held - toe[0 if place == "first" else -1]).max() < 2e-3


def test_feet_come_out_of_the_floor():
    hips, local, contacts = synthetic_walk()
    sunk = hips - (0, 0, 0.06)
    positions, rotations = forward_kinematics(*lock_feet(sunk, local, contacts))
    assert (
        sole_depth(
            forward_kinematics(sunk, local)[0][:, TOES], forward_kinematics(sunk, local)[1][:, ANKLES]
        ).max()
        > 0.04
    )
    assert sole_depth(positions[:, TOES], rotations[:, ANKLES]).max() < 2e-3


def test_push_off_on_tiptoe_comes_down_to_the_ball():
    hips, local, contacts = synthetic_walk()
    raised = hips + (0, 0, 0.025)
    low = forward_kinematics(*lock_feet(raised, local, contacts))[0][:, TOES, 2][contacts]
    kept = forward_kinematics(*lock_feet(raised, local, contacts, ball_height=None))[0][:, TOES, 2][contacts]
    assert np.median(low) < 0.036 and np.median(low) <= np.median(kept)


def test_take_without_contacts_or_of_one_frame():
    hips, local, contacts = synthetic_walk(1)
    assert lock_feet(hips, local, contacts)[1].shape == (1, J, 4)
    hips, local, contacts = synthetic_walk(30)
    assert np.allclose(lock_feet(hips, local, np.zeros_like(contacts))[1], local, atol=2e-3)


# --- frame by frame
# --------------------------------------------------------------------------------------------


def test_stepped_feet_stop_sliding_without_jumps():
    hips, local, contacts = synthetic_walk()
    moved = slid(hips, 0.18)
    new_hips, new_local = run_frames(moved, local, labels_of(contacts))
    firm = contacts.copy()  # while it lands and in the blur of the label at the end, the foot may still move
    for shift in range(1, 6):
        firm[shift:] &= contacts[:-shift]
        firm[:-shift] &= contacts[shift:] if shift < 3 else True
    firm = firm[1:] & firm[:-1]
    before, after = toe_speed(moved, local), toe_speed(new_hips, new_local)
    assert firm.sum() > 60
    assert before[firm].mean() > 0.1 and after[firm].mean() < 0.02
    old, new = forward_kinematics(moved, local)[0], forward_kinematics(new_hips, new_local)[0]
    assert np.abs(np.diff(new, axis=0)).max() < np.abs(np.diff(old, axis=0)).max() + 0.03
    assert np.abs(np.diff(new, n=2, axis=0)).max() < np.abs(np.diff(old, n=2, axis=0)).max() + 0.035
    turn = 2 * np.arccos(np.clip(np.abs(np.sum(new_local[1:] * new_local[:-1], -1)), 0, 1))
    assert np.degrees(turn.max()) < 30
    assert np.all(knee_sines(new_hips, new_local) > -1e-6)


def test_planted_foot_keeps_its_place_to_the_millimetre():
    hips, local, _ = synthetic_walk(40, speed=0.0)
    local, hips = np.repeat(local[:1], 60, 0), np.repeat(hips[:1], 60, 0)
    labels = np.zeros((60, 5))
    labels[:, 3:] = 1
    moved = hips + 0.05 * np.sin(np.arange(60) / 5)[:, None] * np.array((1.0, 0.5, 0))
    positions = forward_kinematics(*run_frames(moved, local, labels))[0][8:, TOES, :2]
    assert np.ptp(positions, axis=0).max() < 2e-3


def test_without_labels_feet_only_clear_the_floor_and_inputs_stay():
    hips, local, _ = synthetic_walk(20)
    kept = hips.copy(), local.copy()
    new_hips, new_local = run_frames(hips, local, np.zeros((20, 5)))
    assert np.array_equal(hips, kept[0]) and np.array_equal(local, kept[1])
    moved = forward_kinematics(new_hips, new_local)[0] - forward_kinematics(hips, local)[0]
    assert (
        np.abs(moved[:, TOES, :2]).max() < 1e-3
        and -1e-3 < moved[:, TOES, 2].min()
        and moved[:, TOES, 2].max() < CLEARANCE + 5e-3
    )
    assert np.abs(new_hips - hips).max() < 5e-3
    run_frames(hips, local, np.ones((20, 5)), hip_goal=(hips[0] + 0.1, 0.4))
    assert np.array_equal(hips, kept[0]) and np.array_equal(local, kept[1])


def test_a_foot_dragged_over_the_floor_is_lifted():
    hips, local, _ = synthetic_walk(1, speed=0.0)
    hips, local = np.repeat(hips, 40, 0), np.repeat(local, 40, 0)
    hips = hips + np.arange(40)[:, None] / 30 * np.array(
        (0, -1.5, 0)
    )  # both feet drag along at walking speed
    new = forward_kinematics(*run_frames(hips, local, np.zeros((40, 5))))[0]
    assert new[10:, TOES, 2].min() > TOE_HEIGHT + 0.025


@pytest.mark.parametrize("speed", [0.3, 0.6])
def test_feet_of_a_gliding_pose_take_steps(speed):
    hips, local, _ = synthetic_walk(1, speed=0.0)
    hips, local = np.repeat(hips, 90, 0), np.repeat(local, 90, 0)
    hips = hips + np.arange(90)[:, None] / 30 * np.array(
        (speed, 0, 0)
    )  # glides on with both feet "in contact"
    labels = np.zeros((90, 5))
    labels[:, 3:] = 1
    new = forward_kinematics(*run_frames(hips, local, labels))[0][:, TOES]
    old = forward_kinematics(hips, local)[0][:, TOES]
    assert np.abs(new - old)[..., :2].max() < 0.25, "they keep up"
    pace = np.linalg.norm(np.diff(new[..., :2], axis=0), axis=-1)
    assert pace.max() < 0.1
    # Each foot stands and steps in turn, and never are both under way.
    stands = pace < 1e-3
    assert (stands.mean(0) > 0.35).all() and (stands[5:].any(axis=1)).mean() > 0.9
    assert (np.diff(stands.astype(int), axis=0) == 1).sum(0).min() >= 2
    # Those that move are lifted: what they slide on the floor is a small part of their way.
    low = (new[1:, :, 2] - TOE_HEIGHT < 0.01) & ~stands
    assert pace[low].sum() < 0.25 * pace.sum()


def test_stepped_feet_stay_over_the_floor():
    hips, local, contacts = synthetic_walk()
    positions, rotations = forward_kinematics(*run_frames(hips - (0, 0, 0.05), local, labels_of(contacts)))
    assert sole_depth(positions[:, TOES], rotations[:, ANKLES]).max() < 5e-3


@pytest.mark.parametrize("offset", [(0.09, -0.06, 0.03), (-0.05, 0.12, -0.04)])
@pytest.mark.parametrize("turn", [0.0, 0.25, -0.3])
def test_hips_come_to_the_seat_and_feet_stay(offset, turn):
    hips, local = seated_pose()
    frames = 45
    labels = np.zeros((frames, 5))
    labels[:, [0, 3, 4]] = 1
    goal = (hips + offset, turn)
    new_hips, new_local = run_frames(
        np.repeat(hips[None], frames, 0), np.repeat(local[None], frames, 0), labels, hip_goal=goal
    )
    error = np.linalg.norm(new_hips - goal[0], axis=-1)
    heading = 2 * np.arctan2(new_local[:, 0, 3], new_local[:, 0, 0])
    assert np.all(error[15:] < 0.03) and np.all(np.abs(wrap_angle(heading - turn))[15:] < np.radians(3))
    assert np.linalg.norm(np.diff(new_hips, axis=0), axis=-1).max() < 0.025  # drawn, not thrown
    toes = forward_kinematics(new_hips, new_local)[0][:, TOES]
    assert np.ptp(toes[8:], axis=0).max() < 5e-3


def test_hips_settle_while_one_still_turns_and_face_the_goal_afterwards():
    hips, local = seated_pose()
    ik, label, goal = ContactIK(), np.array((1.0, 0, 0, 1, 1)), hips + (0.06, 0, 0)
    headings, places = [], []
    for frame in range(60):
        new_hips, new_local = ik.apply(hips, local, label, (goal, None if frame < 30 else 0.2))
        places.append(new_hips)
        headings.append(2 * np.arctan2(new_local[0, 3], new_local[0, 0]))
    start = 2 * np.arctan2(local[0, 3], local[0, 0])
    assert np.linalg.norm(places[29] - goal) < 0.03 and np.allclose(headings[:30], start, atol=1e-6)
    assert abs(headings[-1] - 0.2) < np.radians(1) and np.abs(np.diff(headings)).max() < np.radians(2)


def test_hips_are_let_go_smoothly_when_the_label_falls():
    hips, local = seated_pose()
    labels = np.zeros((60, 5))
    labels[:30, 0] = 1
    new_hips, _ = run_frames(
        np.repeat(hips[None], 60, 0),
        np.repeat(local[None], 60, 0),
        labels,
        hip_goal=(hips + (0.1, 0, 0), 0.0),
    )
    assert abs(new_hips[29, 0] - (0.1 - HIP_PLAY)) < 1e-3 and abs(new_hips[-1, 0]) < 1e-9
    assert np.abs(np.diff(new_hips[:, 0])).max() < 0.012


def test_reset_forgets_the_locks():
    hips, local = seated_pose()
    ik = ContactIK()
    for _ in range(5):
        ik.apply(hips, local, np.ones(5))
    assert ik.locked == (True, True)
    ik.reset()
    assert ik.locked == (False, False)
    away = hips + (3.0, 0, 0)
    moved, _ = ik.apply(away, local, np.zeros(5))
    assert np.array_equal(moved, away)


def test_turning_while_planted_pivots_on_the_ball():
    hips, local, _ = synthetic_walk(1, speed=0.0)
    frames = 60
    hips, local = np.repeat(hips, frames, 0), np.repeat(local, frames, 0)
    local[:, 0] = quat_mul(heading_quat(np.linspace(0, 1.0, frames)), local[:, 0])
    labels = np.zeros((frames, 5))
    labels[:, 3] = 1
    new_hips, new_local = run_frames(hips, local, labels)
    _, rotations = forward_kinematics(new_hips, new_local)
    assert np.isfinite(new_local).all()
    ahead = quat_rotate(rotations[:, ANKLES[0]], np.tile((0.0, -1, 0), (frames, 1)))
    heading = np.unwrap(np.arctan2(ahead[:, 0], -ahead[:, 1]))
    assert heading[15] - heading[5] < 0.02 and heading[-1] > 0.3  # held at first, pivots later
    assert np.abs(np.diff(heading)).max() < 0.2


def test_foot_is_not_thrown_over_a_short_break_of_contact():
    """Labels that flicker while a foot is set elsewhere leave the correction time to pass on."""
    hips, local, _ = synthetic_walk(1, speed=0.0)
    hips, local = np.repeat(hips, 60, 0), np.repeat(local, 60, 0)
    hips[30:, 0] += 0.15
    hips[:, 0] = np.convolve(np.pad(hips[:, 0], 6, mode="edge"), np.ones(13) / 13, mode="valid")
    contacts = np.ones((60, 2), bool)
    contacts[30] = False
    toes = forward_kinematics(*lock_feet(hips, local, contacts))[0][:, TOES]
    assert np.linalg.norm(np.diff(toes, axis=0), axis=-1).max() < 0.05
    assert np.ptp(toes[:20, :, 0], axis=0).max() < 2e-3 and np.ptp(toes[40:, :, 0], axis=0).max() < 2e-3


def test_next_seat_does_not_pull_a_sitter_across():
    hips, local = seated_pose()
    ik, labels, here, there = (
        ContactIK(),
        np.array((1.0, 0, 0, 1, 1)),
        (hips + (0.05, 0, 0), 0.0),
        (hips + (2.0, 1.0, 0), 1.0),
    )
    placed = [ik.apply(hips, local, labels, here, 0.0)[0] for _ in range(30)]
    placed += [ik.apply(hips, local, labels, there, 0.0)[0] for _ in range(10)]
    assert np.linalg.norm(np.diff(placed, axis=0), axis=1).max() < 0.01
    assert np.linalg.norm(placed[-1] - hips) < np.linalg.norm(placed[29] - hips)
