"""Composed sitters come to rest, lean off the back rest with their hands where they were, and turn on the
seat by steps.
"""

from __future__ import annotations

import numpy as np
from walks import seated_pose

from nsm_core.body.skeleton import ARMS, FEET, INDEX, forward_kinematics, root_of
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.sit.fit import RESTLESS, bring_to_rest, keep_off
from nsm_core.data.scenarios.sit.turn import swivel, turn_about_hips
from nsm_core.rotations import heading_quat, quat_mul, wrap_angle
from nsm_core.world.geometry.distance import Cuboids

ANKLES, WRISTS = [leg[2] for leg in FEET], [arm[2] for arm in ARMS]


def seated(count: int = 90, sway: float = 0.0, twist: float = 0.0) -> Motion:
    """A sitter at the origin whose hips circle by ``sway`` metres and turn to and fro by ``twist`` radians,
    feet and all.
    """
    hips, local = seated_pose()
    t = 2 * np.pi * np.arange(count) / 45
    hips = np.repeat(hips[None], count, 0) + sway * np.stack((np.sin(t), np.cos(t), 0 * t), 1)
    local = np.repeat(local[None], count, 0)
    local[:, 0] = quat_mul(heading_quat(twist * np.sin(t)), local[:, 0])
    headings = root_of(forward_kinematics(hips, local)[0])[1]
    motion = Motion(
        hips, local, hips[:, :2].copy(), headings, np.ones((count, 2), bool), [], np.random.default_rng(0)
    )
    return motion


def joints(motion: Motion) -> np.ndarray:
    return forward_kinematics(motion.hips, motion.rotations)[0]


def board(low: tuple[float, float, float], high: tuple[float, float, float]) -> Cuboids:
    return Cuboids([(np.zeros(3), 0.0, np.array((low,)), np.array((high,)))])


def test_hips_come_to_rest_soon_and_the_feet_stay():
    motion = seated(sway=0.02, twist=0.05)
    before, goal = joints(motion), motion.hips[30:75].mean(0)
    facing = root_of(before[30:75])[1].mean()
    bring_to_rest(motion, 10, slice(30, 75), 88)
    off = np.linalg.norm(motion.hips - goal, axis=1)
    assert off[16:75].max() < 1.5 * RESTLESS * 0.02 + 1e-3
    after = joints(motion)
    assert np.abs(wrap_angle(root_of(after[16:75])[1] - facing)).max() < 1.5 * RESTLESS * 0.05 + 2e-3
    np.testing.assert_allclose(after[:, ANKLES], before[:, ANKLES], atol=2e-3)
    np.testing.assert_allclose(motion.hips[:4], before[:4, 0], atol=1e-6)
    assert np.linalg.norm(np.diff(motion.hips, axis=0), axis=1).max() < 0.012  # nothing jumps


def test_backs_lean_off_a_board_and_hands_stay():
    motion = seated()
    before, wall = joints(motion), board((-0.3, 0.07, 0.5), (0.3, 0.11, 1.1))
    keep_off(motion, slice(20, 70), wall)
    after = joints(motion)
    spine = [INDEX["Chest3"], INDEX["Chest4"]]

    def depth(positions: np.ndarray) -> float:
        return float((0.1 - wall.signed_distance(positions[45, spine].astype(np.float32), 0.3)).max())

    assert depth(before) > 0.04 and depth(after) < 0.01
    np.testing.assert_allclose(after[20:70][:, WRISTS], before[20:70][:, WRISTS], atol=0.02)
    np.testing.assert_allclose(after[:, ANKLES], before[:, ANKLES], atol=1e-6)


def test_heels_rise_where_a_high_seat_would_press_thighs_and_toes_stay():
    motion = seated(40)
    before, toes = joints(motion), [leg[3] for leg in FEET]
    thigh = before[20, [INDEX["RightHip"], INDEX["RightKnee"]]].mean(0)
    seat = board((-0.4, thigh[1] - 0.02, 0.3), (0.4, 0.3, thigh[2] - 0.02))
    keep_off(motion, slice(0, 40), seat)
    after = joints(motion)
    knees = [leg[1] for leg in FEET]
    assert (after[20, knees, 2] > before[20, knees, 2] + 0.005).all()
    np.testing.assert_allclose(after[:, toes], before[:, toes], atol=3e-3)
    np.testing.assert_allclose(after[:, 0], before[:, 0], atol=1e-6)
    assert np.linalg.norm(np.diff(after, axis=0), axis=-1).max() < 0.02


def test_a_hand_in_a_slab_comes_out_without_a_jump_and_the_rest_stays():
    motion = seated(60)
    before = joints(motion)
    wrist = before[0, WRISTS[0]]
    slab = board(tuple(wrist - (0.25, 0.25, 0.2)), tuple(wrist + (0.1, 0.25, 0.02)))
    keep_off(motion, slice(0, 60), slab)
    after = joints(motion)
    assert slab.signed_distance(after[30, WRISTS[:1]].astype(np.float32), 0.1).min() > 0.02
    assert np.linalg.norm(np.diff(after, axis=0), axis=-1).max() < 0.025
    others = [INDEX["LeftWrist"], INDEX["LeftToe"], 0]
    np.testing.assert_allclose(after[:, others], before[:, others], atol=0.01)


def test_free_backs_hands_and_low_seats_change_nothing():
    motion, far = seated(), board((5, 5, 0), (6, 6, 1))
    before = motion.rotations.copy()
    keep_off(motion, slice(0, 90), far)
    np.testing.assert_array_equal(motion.rotations, before)


def test_the_turn_ends_where_the_rest_goes_on_and_feet_are_drawn_in():
    for tuck, back in ((0.0, 0.0), (0.24, 0.09)):
        motion, angle = seated(), 1.5
        slide = np.array((-back, 0.0, 0.0))
        start = joints(motion)[0]
        turn_about_hips(motion, 60, 90, angle, slide)
        swivel(motion, 20, 40, angle, tuck, slide)
        after = joints(motion)
        np.testing.assert_allclose(after[59], after[60], atol=2e-3)
        np.testing.assert_allclose(after[19], start, atol=1e-6)
        np.testing.assert_allclose(motion.hips[60] - motion.hips[0], slide, atol=1e-5)
        assert np.ptp(motion.headings) > 0.99 * angle
        reach = np.linalg.norm((after[:, ANKLES] - after[:, :1])[..., :2], axis=-1)
        assert (reach[20:60].min() < 0.85 * reach[0].min()) == (tuck > 0)
        # A foot that stands keeps its place while the body turns.
        for side in (0, 1):
            still = motion.feet[1:, side] & motion.feet[:-1, side]
            still[59:] = False
            assert np.linalg.norm(np.diff(after[:, ANKLES[side]], axis=0), axis=1)[still].max() < 0.004
