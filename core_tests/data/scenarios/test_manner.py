"""Manners of sitting: hands lie where they are to, hang on the way, and heads lead turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from walks import seated_pose

from nsm_core.body.ik.thighs import OVER_THIGH
from nsm_core.body.skeleton import ARMS, FEET, HIP_OVER_SEAT, INDEX, forward_kinematics, root_of
from nsm_core.data.scenarios.gaze import MOST, look_ahead
from nsm_core.data.scenarios.landing import hold
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.sit.draws import SITS
from nsm_core.data.scenarios.sit.manner import SitManner, act_out, draw_manner
from nsm_core.rotations import (
    direction_to_heading,
    heading_quat,
    quat_from_rotvec,
    quat_mul,
    quat_rotate,
    wrap_angle,
)
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.scene import furniture

WRISTS, COUNT = [arm[2] for arm in ARMS], 120
MANNER = SitManner(0.8, 0.8, 1.1, "thighs", (0.6, 0.0), (0.4, 1.0), (0.4, 1.0), 0.1, 0.0, 0.0)


def sitter(weight: np.ndarray) -> Motion:
    """Who is seated by ``weight``, hips higher otherwise, and holds the arms up but for the last frames."""
    hips, local = seated_pose()
    hips = np.repeat(hips[None], len(weight), 0) + (1 - weight)[:, None] * (0, 0, 0.25)
    local = np.repeat(local[None], len(weight), 0)
    for side, sign in (("Right", -1.0), ("Left", 1.0)):
        for frames, angle in ((slice(None), -0.8), (slice(-10, None), 1.35)):
            local[frames, INDEX[f"{side}Shoulder"]] = quat_from_rotvec(np.array((0, sign * angle, 0)))
    headings = root_of(forward_kinematics(hips, local)[0])[1]
    feet = np.ones((len(weight), 2), bool)
    return Motion(hips, local, hips[:, :2].copy(), headings, feet, [], np.random.default_rng(0))


def sat(manner: SitManner, kind: str = "stool") -> tuple[Motion, np.ndarray]:
    n = np.arange(COUNT)
    weight = np.clip(np.minimum(n - 15, COUNT - 16 - n) / 20, 0, 1)
    weight = weight * weight * (3 - 2 * weight)
    motion, piece = sitter(weight), furniture.make(kind, np.random.default_rng(3))
    goal = motion.hips[COUNT // 2].copy()
    act_out(motion, slice(0, COUNT), COUNT // 2, weight, manner, piece, goal, 0.0)
    return motion, forward_kinematics(motion.hips, motion.rotations)[0]


def test_hands_lie_on_the_thighs_and_hang_before_and_after():
    motion, joints = sat(MANNER)
    middle = joints[COUNT // 2]
    for arm, leg in zip(ARMS, FEET, strict=True):
        thigh = middle[leg[1]] - middle[leg[0]]
        off = middle[arm[2]] - (middle[leg[0]] + 0.6 * thigh)
        assert np.linalg.norm(off) == pytest.approx(OVER_THIGH, abs=0.02) and off[2] > 0
    shoulders = joints[:, [arm[0] for arm in ARMS], 2]
    for free in (joints[15], joints[-11]):  # once what was before has faded
        assert (free[WRISTS, 2] < free[[arm[0] for arm in ARMS], 2] - 0.45).all()
    assert (joints[15:, WRISTS, 2] < shoulders[15:] - 0.1).all(), "they are held up no more"
    turn = np.abs((motion.rotations[1:-11] * motion.rotations[:-12]).sum(-1)).clip(0, 1)
    assert np.degrees(2 * np.arccos(turn)).max() < 30  # nothing flips


def test_early_hands_are_there_before_late_ones():
    early, late = (sat(replace(MANNER, down=d, up=d))[1] for d in (SITS.early, SITS.late))
    there = early[COUNT // 2, WRISTS] - early[COUNT // 2, :1]

    def away(joints: np.ndarray) -> float:
        return float(np.linalg.norm(joints[24, WRISTS] - joints[24, :1] - there, axis=-1).mean())

    assert away(early) < 0.6 * away(late)


def test_hands_beside_the_hips_lie_on_the_seat():
    _, joints = sat(replace(MANNER, hands="beside", place=(0.0, 0.25)))
    middle = joints[COUNT // 2]
    seat = middle[0, 2] - HIP_OVER_SEAT
    assert (np.abs(middle[WRISTS, 2] - seat - 0.05) < 0.06).all()
    np.testing.assert_allclose(middle[WRISTS, 0], (-0.25, 0.25), atol=0.05)


def test_the_trunk_leans_and_the_head_looks_on():
    upright, leaning = (sat(replace(MANNER, lean=lean))[1][COUNT // 2] for lean in (0.0, 0.25))
    assert leaning[INDEX["Neck"], 1] < upright[INDEX["Neck"], 1] - 0.05
    np.testing.assert_allclose(leaning[0], upright[0], atol=1e-9)


def test_manners_differ_by_seed_and_suit_the_seat():
    def hands(kind: str, turns: bool = False) -> set[str]:
        found = set()
        for seed in range(40):
            rng = np.random.default_rng(seed)
            found.add(draw_manner(rng, furniture.make(kind, rng), turns).hands)
        return found

    assert hands("stool") == {"beside", "thighs", "lap"} and hands("stool", True) == {"thighs", "lap"}
    assert "rests" in hands("armchair") and "beside" not in hands("armchair")
    drawn = [
        draw_manner(np.random.default_rng(n), furniture.make("chair", np.random.default_rng(n)), False)
        for n in range(40)
    ]
    assert np.ptp([m.sinks for m in drawn]) > 0.7 and np.std([m.lean for m in drawn]) > np.radians(3)


def test_arm_rests_that_no_arm_reaches_are_none():
    for seed in range(6):
        piece = furniture.make("sofa", np.random.default_rng(seed))
        for rest in arm_rests(piece):
            assert rest is None or abs(rest[0] - piece.seat.point[0]) < 0.6


def strode(angle, stands=True):
    """Somebody who stands still but for the right leg, swung by ``angle`` in the first 10 frames."""
    motion = sitter(np.ones(60))
    swung = np.array((np.cos(angle / 2), np.sin(angle / 2), 0, 0))
    motion.rotations[:10, INDEX["RightHip"]] = quat_mul(swung, motion.rotations[:10, INDEX["RightHip"]])
    motion.feet[:] = False
    motion.feet[:20] = (stands, True)
    return motion


def toe(motion):
    return forward_kinematics(motion.hips, motion.rotations)[0][:, FEET[0][3]]


def test_a_foot_stands_once_its_last_step_has_landed():
    motion = strode(0.4, stands=False)
    motion.land(5, 40, 55)
    assert not motion.feet[5:10, 0].any() and motion.feet[10:55, 0].all() and motion.feet[5:55, 1].all()
    assert motion.feet[:5, 1].all() and not motion.feet[55:].any()


def test_a_foot_that_stands_about_right_stays_until_it_is_lifted():
    motion = strode(0.12)
    where = toe(motion)
    assert np.linalg.norm(where[40] - where[4]) > 0.04
    motion.land(5, 40, 55)
    assert motion.feet[:55].all()
    assert np.linalg.norm((toe(motion) - where[4])[5:55, :2], axis=1).max() < 0.01


def test_a_foot_that_stands_far_off_is_set_anew_by_one_raised_step():
    motion = strode(0.5)
    where = toe(motion)
    motion.land(5, 40, 55)
    now, steps = toe(motion), np.flatnonzero(~motion.feet[:55, 0])
    assert len(steps) >= 8 and (np.diff(steps) == 1).all() and motion.feet[:55, 1].all()
    assert np.linalg.norm((now - where)[steps[-1] + 1 : 55], axis=1).max() < 0.02
    assert (now[steps, 2] - np.minimum(now[steps[0] - 1, 2], now[steps[-1] + 1, 2])).max() > 0.04


def test_a_foot_that_stands_on_both_sides_of_a_seam_is_held_where_it_stood():
    motion = strode(0.12)
    motion.feet[20:24] = motion.feet[36:] = True
    where = toe(motion)
    hold(motion, [10])
    now = toe(motion)
    assert np.linalg.norm((now - where[9])[10:24, :2], axis=1).max() < 0.01
    np.testing.assert_allclose(now[36:], where[36:], atol=1e-3)


def test_heads_lead_turns_and_stay_where_nobody_turns():
    still, turning = sitter(np.zeros(90)), sitter(np.zeros(90))
    before = still.rotations.copy()
    look_ahead(still)
    np.testing.assert_allclose(still.rotations, before, atol=1e-6)
    turn = 1.5 * np.clip((np.arange(90) - 30) / 30, 0, 1)
    turning.rotations[:, 0] = quat_mul(heading_quat(turn), turning.rotations[:, 0])
    turning.headings = turning.headings + turn
    look_ahead(turning)
    _, world = forward_kinematics(turning.hips, turning.rotations)
    looks = direction_to_heading(quat_rotate(world[:, INDEX["Head"]], np.array((0.0, -1.0, 0.0)))[:, :2])
    leads = wrap_angle(looks - turning.headings)
    assert 0.3 < leads[32:50].max() < MOST and abs(leads[0]) < 0.05 and abs(leads[-1]) < 0.05
