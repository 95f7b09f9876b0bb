"""Measures of hands, boxes, leaves and ground on motions whose true values are known."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ANKLE_HEIGHT, ARMS, J, forward_kinematics
from nsm_core.conventions import STYLES
from nsm_core.evaluation.measures import objects
from nsm_core.evaluation.measures.motion import foot_sliding, over_ground, travel_report
from nsm_core.rotations import rotate_planar
from nsm_core.world.affordances.passage import passage
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture
from nsm_core.world.scene.door import make_door
from nsm_core.world.scene.furniture import carried_box
from nsm_core.world.scene.props import Box

STILL = Cuboids()


def standing(frames: int = 30, at=(0.0, 0.0, 0.96)) -> tuple[np.ndarray, np.ndarray]:
    local = np.zeros((frames, J, 4))
    local[..., 0] = 1
    return np.tile(np.array(at, dtype=np.float64), (frames, 1)), local


def crate(at=(0, -0.42, 1.1, 0)) -> Box:
    piece = furniture.make("crate", np.random.default_rng(1), width=0.3, depth=0.3, height=0.3)
    return carried_box(piece, np.array(at, dtype=np.float64) - (0, 0, 0.15, 0))


def holding(box: Box, poses: np.ndarray, hips: np.ndarray, facing: float = 0.0, off=(0, 0, 0)) -> np.ndarray:
    """Local rotations of a stander whose wrists are on the grasps in every frame, moved by ``off``."""
    local = standing(len(poses))[1]
    grasps = np.stack([box.to_world(box.grasps(facing), pose) for pose in poses])
    return place_limbs(hips, local, ARMS, grasps + np.asarray(off))


def test_a_box_in_both_hands_is_held_and_placed():
    hips, _ = standing(40)
    box = crate()
    poses = np.repeat(box.pose[None], 40, 0)
    poses[5:, 2] += np.minimum(np.arange(35) * 0.005, 0.1)
    report = objects.box_report(
        box, poses, hips, holding(box, poses, hips), STILL, np.append(poses[-1, :3], np.pi / 2)
    )
    assert (
        report["hands_off_worst_cm"] < 0.5 and report["box_unheld_cm"] == 0 and report["hands_tilt_deg"] < 1
    )
    assert report["box_error_cm"] == pytest.approx(0, abs=1e-6) and report["box_turn_deg"] == pytest.approx(
        0, abs=1e-6
    )
    assert report["box_in_solids_cm"] == 0 and report["box_moved"] == 1
    tilted = np.array(((0, 0, 0.03), (0, 0, -0.03)))
    report = objects.box_report(box, poses, hips, holding(box, poses, hips, off=tilted), STILL, poses[-1])
    assert report["hands_tilt_deg"] == pytest.approx(np.degrees(np.arctan2(0.06, 0.36)), abs=0.6)
    assert report["hands_off_cm"] == pytest.approx(3, abs=0.3)


def test_a_box_that_glides_by_itself_is_found_out():
    hips, local = standing(40)
    box = crate((0, -1.5, 0.5, 0))
    poses = np.repeat(box.pose[None], 40, 0)
    poses[10:, 1] -= np.minimum(np.arange(30) * 0.01, 0.2)
    poses[30:, 3] = 0.2
    report = objects.box_report(box, poses, hips, local, STILL, box.pose)
    assert report["box_unheld_cm"] == pytest.approx(20, abs=0.1)
    assert report["box_error_cm"] == pytest.approx(20, abs=0.1) and report["box_turn_deg"] == pytest.approx(
        np.degrees(0.2), abs=0.01
    )
    assert np.isnan(report["hands_tilt_deg"])


def test_a_box_through_a_table_or_the_floor_is_measured():
    table = furniture.make("table", np.random.default_rng(0), height=0.7)
    solids = furniture.cuboids([(table, np.zeros(2), 0.0)])
    box = crate((0, 0, 0.7 + 0.15, 0.3))
    poses = np.repeat(box.pose[None], 5, 0)
    assert objects.box_in_solids(box, poses, solids) < 1e-4
    poses[3, 2] -= 0.03
    assert objects.box_in_solids(box, poses, solids) == pytest.approx(0.03, abs=1e-3)
    poses[3, 2] -= 0.07  # the board, 4 cm thick, is inside the box now
    assert objects.box_in_solids(box, poses, solids) == pytest.approx(0.1, abs=1e-3)
    poses[:] = (2, 2, 0.1, 0)
    assert objects.box_in_solids(box, poses, solids) == pytest.approx(0.05, abs=1e-3)


def test_a_leaf_swung_into_a_body_and_away_from_it():
    door = make_door(np.random.default_rng(2), width=0.9)
    leaf = door.leaf((0, 0, 0, 0), swing=1.0)
    hips, local = standing(2, (0.45, 0.45, 0.96))
    poses = np.stack((leaf.pose_at(0.0), leaf.pose_at(np.pi / 4)))
    depths = objects.prop_depths(hips, local, leaf, poses)
    assert depths[0] == 0 and depths[1] > 0.08
    # The hand of a stretched arm closes around the handle; the same hand through the panel counts.
    reach = forward_kinematics(hips, local)[0][0, ARMS[0][2]] + (-0.1, 0, 0)
    for handle, inside in ((0.85, False), (0.3, True)):
        at = make_door(np.random.default_rng(2), width=0.9, handle_edge=0.05).leaf((0, 0, 0, 0))
        at.handle = np.array((handle, 0, reach[2]))
        beside = hips + np.array((0.85, 0.0, 0)) - np.array((reach[0], reach[1], 0))
        assert (objects.prop_depths(beside[:1], local[:1], at, at.pose[None])[0] > 0.02) == inside
    together = objects.all_depths(hips, local, STILL, {"Door": leaf}, {"Door": poses})
    assert np.allclose(together, depths) and objects.deep_frames(together) == {
        "frames": 2.0,
        "deep_frames": 1.0,
    }


@pytest.mark.parametrize("start", [(0.4, -1.5), (0.4, 1.5)])
def test_the_hand_on_the_handle_and_a_leaf_that_goes_on_alone(start):
    leaf = make_door(np.random.default_rng(3)).leaf((1, 2, 0, 0.7), swing=1.0)
    way = passage(leaf, leaf.to_world(np.append(start, 0.0))[:2])
    angles = np.radians(np.concatenate((np.zeros(5), np.linspace(0, 60, 31)[1:])))
    poses = np.stack([leaf.pose_at(a) for a in angles])
    grips = np.stack([leaf.grip(way.side, a) for a in angles])
    grips[20:] = grips[20]  # the hand stays where it is, the leaf swings on
    hips = np.column_stack((grips[:, :2], np.full(35, 0.7)))
    hips[:, :2] -= 0.25 * np.array((np.sin(way.heading), -np.cos(way.heading)))
    arm = ARMS[way.hand]
    local = standing(35)[1]
    local[:, 0] = (np.cos(way.heading / 2), 0, 0, np.sin(way.heading / 2))
    local = place_limbs(hips, local, (arm,), grips[:, None])
    reached = np.linalg.norm(forward_kinematics(hips, local)[0][:, arm[2]] - grips, axis=-1)
    report = objects.leaf_report(leaf, poses, way.side, way.hand, hips, local)
    assert report["leaf_widest_deg"] == pytest.approx(60, abs=0.01) and report[
        "leaf_step_deg"
    ] == pytest.approx(2, abs=0.01)
    assert reached[:20].max() < 0.02 and 0.1 < report["leaf_alone_share"] < 0.4
    assert report["grip_off_cm"] < 10 < report["grip_off_worst_cm"]


def test_feet_slide_over_what_they_stand_on():
    hips, local = standing(40, (0, 0, 0.96 + 0.3))
    hips[:, 1] = -0.009 * np.arange(40)
    positions = forward_kinematics(hips, local)[0]
    low = float(positions[..., 2].min())
    hips[:, 2] -= low - 0.3 - 0.025
    positions = forward_kinematics(hips, local)[0]

    def ground(points: np.ndarray) -> np.ndarray:
        return np.full(len(points), 0.3)

    assert foot_sliding(positions) == 0
    assert foot_sliding(positions, ground=ground) == pytest.approx(27, abs=0.1)
    assert np.allclose(over_ground(positions, ground)[:, [17, 21], 2], ANKLE_HEIGHT, atol=0.01)
    assert np.allclose(objects.foot_heights(positions[0], ground), 0, atol=1e-6)
    report = travel_report(hips, local, ground=ground)
    assert report["slide_moving_cm_s"] == 0 and report["foot_sliding_cm_s"] == pytest.approx(27, abs=0.1)
    assert (
        report["below_floor_share"] == 0
        and travel_report(hips, local, ground=lambda p: ground(p) + 0.05)["below_floor_share"] == 1
    )


def test_slide_is_told_by_action():
    hips, local = standing(60)
    hips[:, 2] -= forward_kinematics(hips, local)[0][..., 2].min() - 0.025
    hips[30:, 1] -= 0.02 * np.arange(30)
    style = np.zeros((60, 7))
    style[:30, STYLES.index("idle")] = 1
    style[30:, STYLES.index("walk")] = 1
    style[45:, STYLES.index("carry")] = 0.9
    positions = forward_kinematics(hips, local)[0]
    sums = objects.slide_by_action(positions, style)
    table = objects.slide_table([sums, sums])
    assert table == pytest.approx({"idle": 0, "walk": 60, "carry": 60, "all": 60 * 29 / 59}, abs=0.01)
    assert (
        objects.leading_action(style)[[0, 30, 50]] == [STYLES.index(n) for n in ("idle", "walk", "carry")]
    ).all()


def test_moving_frames_and_wrists():
    poses = np.zeros((4, 4))
    poses[2:, 3], poses[3, 0] = 0.1, 0.05
    assert objects.moving_frames(poses).tolist() == [False, False, True, True]
    hips, local = standing(1)
    right, left = objects.wrists(hips, local)[0]
    assert right[0] < -0.6 and left[0] > 0.6
    assert np.allclose(rotate_planar(right, np.pi)[:2], left[:2], atol=0.1)
