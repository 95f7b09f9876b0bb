"""Boxes and leaves: where hands hold them, where one stands, and that they are sensed where they are."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import ARM_LENGTH, ARMS, INDEX, J, forward_kinematics
from nsm_core.distances import BODY_TO_BOX, WRIST_BEHIND, WRIST_BELOW, WRIST_OFF_HANDLE, WRIST_OFF_SIDE
from nsm_core.errors import GoalError
from nsm_core.rotations import heading_to_direction, rotate_planar
from nsm_core.world.affordances.passage import passage
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Box, Leaf, sense

SIZE = np.array((0.4, 0.3, 0.25))


def crate(pose=(1.0, -2.0, 0.5, 0.6)) -> Box:
    query = Cuboids([((0, 0, 0), 0.0, -SIZE[None] / 2, SIZE[None] / 2)])
    return Box("Box", query, sense(query, -SIZE / 2, SIZE / 2), np.array(pose), SIZE)


def door(swing: float = 1.0, pose=(0.5, 1.0, 0.0, 0.4)) -> Leaf:
    low, high = np.array((0, -0.02, 0.01)), np.array((0.9, 0.02, 2.03))
    query = Cuboids([((0, 0, 0), 0.0, low[None], high[None])])
    return Leaf(
        "Door",
        query,
        sense(query, low, high),
        np.array(pose),
        0.9,
        np.array((0.83, 0, 1.0)),
        0.12,
        swing,
        pose[3],
    )


@pytest.mark.parametrize("facing", [0.0, np.pi / 2, np.pi, -np.pi / 2])
def test_wrists_lie_beside_the_box_right_and_left_of_the_carrier(facing):
    box = crate()
    right, left = (rotate_planar(p[:2], np.float64(-facing)) for p in box.grasps(facing))
    width, depth = box.across(facing)
    assert (width, depth) == pytest.approx((0.4, 0.3) if abs(np.sin(facing)) < 0.5 else (0.3, 0.4))
    assert -right[0] == pytest.approx(width / 2 + WRIST_OFF_SIDE) and left[0] == pytest.approx(
        width / 2 + WRIST_OFF_SIDE
    )
    assert right[1] == pytest.approx(left[1]) and right[1] > 0, (
        "hands reach on over the sides from behind its centre"
    )
    distance = box.query.signed_distance(box.grasps(facing).astype(np.float32), 0.2)
    np.testing.assert_allclose(distance, WRIST_OFF_SIDE, atol=1e-6)
    assert box.stand_off(facing) == pytest.approx(depth / 2 + BODY_TO_BOX)


@pytest.mark.parametrize("facing", [0.0, np.pi / 2])
def test_only_large_boxes_are_held_otherwise_than_in_the_data_and_shown_higher_for_it(facing):
    box, large = crate(), crate()
    box.size, large.size = np.array((0.38, 0.3, 0.25)), np.array((0.5, 0.5, 0.5))
    np.testing.assert_allclose(box.grasps(facing), box.learned_grasps(facing))
    assert not box.raised.any()
    held, learned = (
        rotate_planar(p, np.float64(-facing)) for p in (large.grasps(facing), large.learned_grasps(facing))
    )
    np.testing.assert_allclose(
        learned, [(sign * (0.25 + WRIST_OFF_SIDE), WRIST_BEHIND, -WRIST_BELOW * 0.5) for sign in (-1, 1)]
    )
    assert (held[:, 1] > learned[:, 1] + 0.03).all()
    np.testing.assert_allclose((learned + large.raised)[:, 2], held[:, 2])


def test_frames_lead_there_and_back_and_solids_move_along():
    box, points = crate(), np.random.default_rng(0).normal(size=(20, 3))
    np.testing.assert_allclose(box.to_local(box.to_world(points)), points, atol=1e-12)
    near = box.to_world(np.array(((0, 0, 0), (0.25, 0, 0))))
    np.testing.assert_allclose(box.signed_distance(near, 0.2), (-0.125, 0.05), atol=1e-6)
    box.pose = np.array((5.0, 5, 1, 0))
    assert (box.signed_distance(near, 0.2) == np.float32(0.2)).all()


def test_reading_moves_with_the_prop():
    box = crate()
    seen = box.sensed()
    np.testing.assert_allclose(seen.centre, box.pose[:3], atol=1e-6)
    assert seen.heading == pytest.approx(0.6) and (seen.occupancy == 1).all()
    box.pose[:] = (0, 0, 2, -1)
    np.testing.assert_allclose(box.sensed().centre, (0, 0, 2), atol=1e-6)


@pytest.mark.parametrize("pose", [(0, 0, 0), (0, 0, np.nan, 0)])
def test_a_prop_without_a_place_is_refused_in_a_sentence(pose):
    with pytest.raises(GoalError, match=r"Box has no usable place.*\.$"):
        crate(pose)


@pytest.mark.parametrize("swing", [1.0, -1.0])
def test_handle_goes_round_the_hinge(swing):
    leaf = door(swing)
    grips = np.array([leaf.grip(1.0, a) for a in np.linspace(0, 1.5, 7)])
    np.testing.assert_allclose(
        np.linalg.norm(grips[:, :2] - leaf.pose[:2], axis=1),
        np.hypot(0.83, 0.06 + WRIST_OFF_HANDLE),
        atol=1e-9,
    )
    np.testing.assert_allclose(grips[:, 2], 1.0)
    leaf.pose = leaf.pose_at(0.8)
    assert leaf.angle == pytest.approx(0.8)
    np.testing.assert_allclose(leaf.grip(1.0), leaf.grip(1.0, 0.8))


@pytest.mark.parametrize("swing", [1.0, -1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_passage_leads_through_the_opening(swing, side):
    leaf = door(swing)
    through = side * rotate_planar(np.array((0.0, 1.0)), np.float64(leaf.closed))
    start = leaf.pose[:2] + 2.5 * through
    way = passage(leaf, start)
    ahead = heading_to_direction(np.array(way.heading))
    np.testing.assert_allclose(ahead, -through, atol=1e-9)
    assert way.side == side
    # A push moves the handle away from who comes, a pull towards them.
    moved = (leaf.grip(way.side, 0.5) - leaf.grip(way.side, 0.0))[:2] @ ahead
    assert way.push == (moved > 0)

    def seen(p):
        return float((p - leaf.pose[:2]) @ ahead)

    assert seen(way.reach) < -0.2 and seen(way.back) <= seen(way.reach) + 1e-9 and seen(way.beyond) > 0.8
    assert seen(way.middle) == pytest.approx(0)
    np.testing.assert_allclose(way.middle, leaf.to_world(np.array((0.45, 0, 0)))[:2])
    # Standing there, the shoulder of the chosen hand is no further than an arm and a lean from the handle.
    local = np.zeros((J, 4))
    local[:, 0] = 1
    local[0] = (np.cos(way.heading / 2), 0, 0, np.sin(way.heading / 2))
    joints, _ = forward_kinematics(np.append(way.reach, 0.93), local)
    gap = np.linalg.norm(joints[ARMS[way.hand][0]] - leaf.grip(way.side, 0.0))
    assert gap < ARM_LENGTH + 0.12 and joints[INDEX["Hips"], 2] == pytest.approx(0.93)


def test_an_open_box_reads_as_a_full_one():
    """Hands hold what is around it: a bin without a lid must not look like another thing to the network."""
    walls = (
        [(-0.2, -0.2, -0.2), (0.18, -0.2, -0.2), (-0.2, -0.2, -0.2)],
        [(-0.18, 0.2, 0.2), (0.2, 0.2, 0.2), (0.2, 0.2, -0.18)],
    )
    query = Cuboids([((0, 0, 0), 0.0, *walls)])
    bin_ = Box(
        "bin", query, sense(query, (-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)), (1.0, 0, 0.2, 0.5), np.full(3, 0.4)
    )
    assert bin_.volume.occupancy.min() < 0.5
    volume = bin_.sensed()
    assert (volume.occupancy == 1).all() and volume.heading == pytest.approx(0.5)
    np.testing.assert_allclose(volume.centre, (1.0, 0, 0.2), atol=1e-6)
