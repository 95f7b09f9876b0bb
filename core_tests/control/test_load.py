"""Loads: a body that leans back as its law says, shoulders that drop, a slower pace, and no more."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import ARMS, HIPS, INDEX, OFFSETS, J
from nsm_core.body.tree import HUMAN
from nsm_core.control.load import BODY, EASY, MOST_BACK, MOST_LEAN, SLOWEST, leant, pace_with
from nsm_core.rotations import heading_quat, heading_to_direction, quat_from_rotvec, quat_mul

FRAMES, HEADING = 60, 0.7
AHEAD = np.append(heading_to_direction(np.array(HEADING)), 0.0)
NECK, HEAD = INDEX["Neck"], INDEX["Head"]


def standing(bow: float = 0.0) -> Pose:
    """A body that stands and faces ``HEADING``, bowed by an angle."""
    turns = np.zeros((FRAMES, J, 3))
    turns[:, [INDEX[n] for n in ("Chest", "Chest2", "Chest3")], 0] = bow / 3
    local = quat_from_rotvec(turns)
    local[:, HIPS] = quat_mul(np.tile(heading_quat(np.array(HEADING)), (FRAMES, 1)), local[:, HIPS])
    return Pose(HUMAN, np.tile(OFFSETS[0].astype(float), (FRAMES, 1)), local)


def bearing(kilograms: float, bow: float = 0.0, at: float = 0.45) -> tuple[Pose, Pose]:
    """A body without, and with a load at so many metres before its hips from the middle of the motion on."""
    pose = standing(bow)
    kg = np.where(np.arange(FRAMES) < FRAMES // 2, 0.0, kilograms)
    return pose, leant(pose, kg, pose.hips + at * AHEAD + (0, 0, 0.2))


def pitch(pose: Pose) -> np.ndarray:
    """Degrees (T,) by which the trunk leans forward."""
    trunk = pose.positions[:, NECK] - pose.hips
    return np.degrees(np.arctan2(trunk @ AHEAD, trunk[:, 2]))


def test_who_bears_a_tenth_of_his_weight_leans_back_by_some_five_degrees():
    before, after = bearing(BODY / 10)
    lean = (pitch(after) - pitch(before))[[0, -1]]
    assert lean[0] == pytest.approx(0, abs=0.01) and -6 < lean[1] < -3
    shift = (after.hips - before.hips)[-1]
    assert -0.03 < shift @ AHEAD < -0.01 and np.linalg.norm(shift - (shift @ AHEAD) * AHEAD) < 1e-6
    assert np.abs(np.diff(pitch(after))).max() < 1.0, "it comes without a jolt"


def test_heavier_and_further_loads_lean_more_up_to_an_end():
    leans = [
        pitch(bearing(kg, at=at)[1])[-1] for kg, at in ((2, 0.45), (5, 0.45), (5, 0.6), (12, 0.6), (60, 0.9))
    ]
    assert (np.diff(leans) < 0).all()
    assert leans[-1] > -np.degrees(MOST_LEAN + MOST_BACK) - 1


def test_shoulders_drop_and_the_head_looks_where_it_did():
    before, after = bearing(12.0)

    def drop(pose):
        return pose.positions[-1, NECK, 2] - pose.positions[-1, [arm[0] for arm in ARMS], 2]

    assert (drop(after) - drop(before)).min() > 0.005
    assert after.world[:, HEAD] == pytest.approx(before.world[:, HEAD], abs=1e-6)


def test_who_bends_or_bears_nothing_does_not_lean():
    pose = standing()
    assert leant(pose, np.zeros(FRAMES), pose.hips) is pose
    before, after = bearing(12.0, bow=1.4)
    assert after.positions == pytest.approx(before.positions, abs=1e-6)


def test_only_what_is_heavy_slows_a_walk():
    assert pace_with(0.0) == pace_with(EASY * BODY) == 1.0
    assert pace_with(15.0) == pytest.approx(0.9) and pace_with(200.0) == SLOWEST
