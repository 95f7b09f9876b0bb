"""Measures of travel on motions whose true values are known."""

from __future__ import annotations

import json

import numpy as np
import pytest
from walks import seated_rotations, synthetic_walk

from nsm_core.body.capsules import Body, penetration_depths
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import FEET, HIP_OVER_SEAT, INDEX, J, forward_kinematics
from nsm_core.conventions import STYLES
from nsm_core.evaluation.measures import motion
from nsm_core.evaluation.measures.motion import travel_report
from nsm_core.rotations import quat_from_rotvec


def standing(frames: int = 60) -> tuple[np.ndarray, np.ndarray]:
    hips = np.tile((0.0, 0, 0.97), (frames, 1))
    local = np.zeros((frames, J, 4))
    local[..., 0] = 1
    return hips, local


def gliding(frames: int = 60, speed: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    hips, local = standing(frames)
    hips[:, 1] = -speed / 30 * np.arange(frames)
    return hips, local


class Slab:
    """Solid under a height, as a distance query."""

    def __init__(self, top: float) -> None:
        self.top = top

    def signed_distance(self, points: np.ndarray, max_distance: float) -> np.ndarray:
        return np.minimum(points[:, 2] - self.top, max_distance).astype(np.float32)


def test_honest_walk():
    hips, local, _ = synthetic_walk()
    report = travel_report(hips, local)
    assert report["planted_share"] > 0.85
    assert report["top_speed_m_s"] == pytest.approx(1.0, abs=0.01)
    assert report["path_ratio"] == pytest.approx(1.0, abs=0.02)
    assert report["knee_backward_deg"] == 0 and report["elbow_backward_deg"] == 0
    assert report["below_floor_share"] == 0
    assert report["slide_moving_weighted_cm_s"] < 15
    json.dumps(report, allow_nan=False)


def test_gliding_is_found_out():
    report = travel_report(*gliding())
    assert report["planted_share"] == 0
    assert report["foot_sliding_cm_s"] == pytest.approx(100, abs=0.1)
    assert report["slide_moving_cm_s"] == pytest.approx(100, abs=0.1)
    assert report["slide_moving_weighted_cm_s"] == pytest.approx(100, abs=0.1)


def test_standing_still_has_nothing_to_report():
    report = travel_report(*standing())
    assert (
        report["foot_sliding_cm_s"]
        == report["slide_moving_cm_s"]
        == report["jerk_m_s3"]
        == report["top_speed_m_s"]
        == 0
    )
    assert report["planted_share"] == report["path_ratio"] == 1


def test_only_low_joints_slide():
    hips, local = gliding()
    positions, _ = forward_kinematics(hips + (0, 0, 0.03), local)
    assert motion.foot_sliding(positions) == 0
    positions, _ = forward_kinematics(hips + (0, 0, 0.02), local)
    assert motion.foot_sliding(positions) == pytest.approx(100, abs=0.1)


def test_slow_drift_slides_but_does_not_move():
    report = travel_report(*gliding(speed=0.1))
    assert report["foot_sliding_cm_s"] == pytest.approx(10, abs=0.05) and report["slide_moving_cm_s"] == 0


def test_top_speed_ignores_a_single_wrong_frame():
    hips, local = gliding()
    hips[30, 1] -= 0.01
    assert travel_report(hips, local)["top_speed_m_s"] == pytest.approx(1.1, abs=0.02)


def test_detour_and_given_shortest_way():
    hips, local = standing(121)
    angle = np.linspace(0, np.pi, 121)
    hips[:, :2] = np.stack((np.cos(angle), np.sin(angle)), -1)
    positions, _ = forward_kinematics(hips, local)
    assert motion.path_ratio(positions) == pytest.approx(np.pi / 2, abs=0.03)
    assert motion.path_ratio(positions, shortest=np.pi) == pytest.approx(1, abs=0.02)


def test_actions_are_counted():
    walk, sit, idle = (STYLES.index(s) for s in ("walk", "sit", "idle"))
    action = np.zeros((200, 7))
    action[:60, walk] = 1
    action[60:120, sit] = 1
    action[120:150, idle] = 1
    action[150:, sit] = 1
    action[100:102] = 0
    action[100:102, idle] = 1  # a flicker of two frames
    assert motion.action_changes(action) == (3, 2)
    assert travel_report(*standing(200), action=action)["sit_count"] == 2
    wavering = np.zeros((60, 7))
    wavering[:, walk] = 0.5 + 0.04 * (-1.0) ** np.arange(60)
    wavering[:, idle] = 0.5
    assert motion.action_changes(wavering) == (0, 0)


def test_sitting_as_told_touches_but_does_not_penetrate():
    top = 0.45
    hips, local = np.array((0.0, 0, top + HIP_OVER_SEAT)), seated_rotations()
    # Hands down beside the body, over the seat.
    for name, turn in (("RightShoulder", -1.2), ("LeftShoulder", 1.2)):
        local[INDEX[name]] = quat_from_rotvec(np.array((0, turn / 3, 0)))
    local = place_limbs(
        hips, local, (FEET[0][:3], FEET[1][:3]), np.array(((-0.1, -0.42, 0.5), (0.1, -0.42, 0.5)))
    )
    hips, local = np.repeat(hips[None], 4, 0), np.repeat(local[None], 4, 0)

    def depth(height: float) -> dict[str, float]:
        legs_free = Slab(height)
        body = Body.of(hips, local)
        seated = body.centres[0, :, 1] > -0.2  # the seat ends before the knees
        inside = np.maximum(
            0, body.radii[0, seated] - legs_free.signed_distance(body.centres[0, seated], 1.0)
        )
        return float(inside.max())

    assert depth(top) < 0.02
    assert 0.045 < depth(top + 0.05) < 0.07


def test_depth_of_a_body_in_a_slab():
    hips, local = standing(10)
    hips[5:, 2] -= 0.1
    report = motion.depth_report(penetration_depths(hips, local, Slab(0.05)))
    toe_depth = 0.05 - (0.025 - 0.1) + 0.025
    assert report["penetration_cm"] == pytest.approx(100 * toe_depth, abs=2.0)
    assert report["penetration_share"] == 1.0
    assert motion.depth_report(penetration_depths(hips[:5], local[:5], Slab(-0.5)))["penetration_cm"] == 0


def test_backward_joints_are_named():
    hips, local = standing(3)
    local[1, INDEX["LeftKnee"]] = quat_from_rotvec(np.array((-0.3, 0, 0)))
    local[2, INDEX["RightElbow"]] = quat_from_rotvec(np.array((0, 0, -0.2)))
    bend = motion.backward_bend(hips, local)
    assert bend["knee_backward_deg"] == pytest.approx(np.degrees(0.3), abs=0.01)
    assert bend["elbow_backward_deg"] == pytest.approx(np.degrees(0.2), abs=0.01)


def test_jumps_and_floor():
    hips, local = standing(30)
    local[15:, INDEX["Head"]] = quat_from_rotvec(np.array((0, 0, 0.5)))
    hips[20:, 0] += 0.1
    hips[25:, 2] -= 0.03
    report = travel_report(hips, local)
    assert report["turn_per_frame_deg"] == pytest.approx(np.degrees(0.5), abs=0.01)
    assert report["move_per_frame_cm"] == pytest.approx(10, abs=0.01)
    assert report["jolt_cm"] == pytest.approx(10, abs=0.01)
    assert report["below_floor_share"] == pytest.approx(5 / 30) and report["below_floor_cm"] == pytest.approx(
        3.0, abs=0.6
    )


def test_jerk_of_a_cubic():
    hips, local = standing(30)
    hips[:, 0] = (np.arange(30) / 30.0) ** 3
    positions, _ = forward_kinematics(hips, local)
    assert motion.jerk(positions) == pytest.approx(6.0, rel=1e-3)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_short_takes(frames):
    hips, local = standing(frames)
    json.dumps(
        travel_report(hips, local, action=np.eye(7)[:1].repeat(frames, 0), query=Slab(-1.0)), allow_nan=False
    )
