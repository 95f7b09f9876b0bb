"""The five steps of augmentation: contacts land on the new object, feet stay, nothing changes for the same
object.
"""

from __future__ import annotations

import numpy as np
import pytest
from captures import sit, stand

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ANKLE_HEIGHT, ARMS, FEET, HIP_OVER_SEAT, forward_kinematics
from nsm_core.conventions import FOOT_CONTACTS, HAND_CONTACTS, HIP_CONTACT
from nsm_core.data.augmentation.contact_transfer import (
    KEY_JOINTS,
    align,
    embed,
    fit_template,
    switch,
    transfer,
)
from nsm_core.errors import GeometryError
from nsm_core.rotations import rotate_planar
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import make

SEATED = slice(72, 132)  # frames of captures.sit in which the hips rest


def chair(**measures):
    kind = measures.pop("kind", "armchair")
    return make(
        kind,
        np.random.default_rng(0),
        **({"arm_style": "block", "arm_start": 0.0} if kind == "armchair" else {}) | measures,
    )


@pytest.fixture(scope="module")
def sitting():
    """A sit with the wrists on the arm rests of the template: motion, contacts, template and its pose."""
    hips, rotations = sit()
    template, pose = fit_template(
        hips, rotations, 100, chair(width=0.5, depth=0.5, arm_width=0.08, arm_height=0.2)
    )
    wrists = np.stack([rotate_planar(np.asarray(r, float), pose[3]) + pose[:3] for r in arm_rests(template)])
    before = forward_kinematics(hips, rotations)[0][:, [arm[2] for arm in ARMS]]
    w = np.interp(np.arange(len(hips)), (40, 72, 132, 164), (0, 1, 1, 0))[:, None, None]
    rotations = place_limbs(hips, rotations, ARMS, before + w * (wrists - before))
    contacts = np.zeros((len(hips), 5))
    contacts[:, FOOT_CONTACTS] = 1
    contacts[SEATED, HIP_CONTACT] = 1
    contacts[SEATED, HAND_CONTACTS[0]] = contacts[SEATED, HAND_CONTACTS[1]] = 1
    return hips, rotations, contacts, template, pose


def joints_of(motion):
    return forward_kinematics(*motion)[0][:, KEY_JOINTS]


def test_the_template_lies_under_the_sitter(sitting):
    hips, rotations, contacts, template, pose = sitting
    assert template.seat.height == pytest.approx(hips[100, 2] - HIP_OVER_SEAT, abs=1e-5)
    e = embed(hips, rotations, contacts, template, pose)
    assert e.touch[SEATED][:, [HIP_CONTACT, *HAND_CONTACTS]].all() and not e.touch[:72].any()
    assert e.floor.all() and not e.touch[:, FOOT_CONTACTS].any()


def test_the_same_object_leaves_the_motion_as_it_was(sitting):
    hips, rotations, contacts, template, pose = sitting
    new_hips, new_rotations = transfer(embed(hips, rotations, contacts, template, pose), template, pose)
    np.testing.assert_allclose(new_hips, hips, atol=1e-6)
    np.testing.assert_allclose(np.abs((new_rotations * rotations).sum(-1)), 1, atol=1e-5)


@pytest.mark.parametrize("height", [0.36, 0.44, 0.52])
def test_hips_and_hands_land_on_another_chair_and_the_feet_stay(sitting, height):
    hips, rotations, contacts, template, pose = sitting
    other = chair(seat_height=height, width=0.56, depth=0.55, arm_width=0.12, arm_height=0.22)
    new_pose = align(template, pose, other)
    e = embed(hips, rotations, contacts, template, pose)
    moved = joints_of(transfer(e, other, new_pose))
    before = joints_of((hips, rotations))
    seat = rotate_planar(other.seat.point.astype(float), new_pose[3]) + new_pose[:3]
    np.testing.assert_allclose(moved[SEATED, 0].mean(0)[2], seat[2] + HIP_OVER_SEAT, atol=1e-3)
    assert np.linalg.norm(moved[SEATED, 0, :2] - seat[:2], axis=-1).max() < 0.05
    for side, k in enumerate(HAND_CONTACTS):
        rest = rotate_planar(np.asarray(arm_rests(other)[side], float), new_pose[3]) + new_pose[:3]
        assert np.linalg.norm(moved[SEATED, k] - rest, axis=-1).max() < 0.01
    assert np.linalg.norm(moved[:, FOOT_CONTACTS] - before[:, FOOT_CONTACTS], axis=-1).max() < 0.01
    # A second away from the contacts all is as captured, and nothing jumps on the way.
    np.testing.assert_allclose(moved[:40], before[:40], atol=1e-3)
    jumps = np.linalg.norm(np.diff(moved - before, axis=0), axis=-1)
    assert jumps.max() < 0.02


def test_a_turned_and_moved_object_takes_the_sitter_along(sitting):
    hips, rotations, contacts, template, pose = sitting
    other = pose + (0.1, -0.05, 0, 0.2)
    e = embed(hips, rotations, contacts, template, pose)
    moved = joints_of(transfer(e, template, other))
    local = rotate_planar(joints_of((hips, rotations))[100] - pose[:3], np.full(5, -pose[3]))
    expected = rotate_planar(local, np.full(5, other[3])) + other[:3]
    np.testing.assert_allclose(moved[100, :3], expected[:3], atol=0.01)


def test_a_chair_without_arms_lets_the_hands_go_with_the_body(sitting):
    hips, rotations, contacts, template, pose = sitting
    stool = chair(kind="chair", seat_height=0.5)
    e = embed(hips, rotations, contacts, template, pose)
    moved, before = joints_of(transfer(e, stool, align(template, pose, stool))), joints_of((hips, rotations))
    shift = moved - before
    np.testing.assert_allclose(shift[100, HAND_CONTACTS], shift[100, [0, 0]], atol=1e-5)
    with pytest.raises(GeometryError, match="Nobody sits on a table"):
        transfer(e, make("table", np.random.default_rng(0)), pose)


def test_two_frames_come_out_as_in_the_whole_take_and_repeat_by_seed(sitting):
    hips, rotations, contacts, template, pose = sitting
    e = embed(hips, rotations, contacts, template, pose)
    pool = Pool()
    for seed in (3, 4):
        other, again = switch(pool, "armchair", seed), switch(pool, "armchair", seed)
        np.testing.assert_array_equal(other.mins, again.mins)
        whole = transfer(e, other, align(template, pose, other))
        for first in (10, 55, 131, 170):
            pair = transfer(e, again, align(template, pose, again), slice(first, first + 2))
            np.testing.assert_allclose(pair[0], whole[0][first : first + 2], atol=1e-6)
            np.testing.assert_allclose(np.abs((pair[1] * whole[1][first : first + 2]).sum(-1)), 1, atol=1e-6)


def test_feet_climb_a_higher_step_and_the_hips_with_them():
    hips, rotations = stand(120)
    block = make("step", np.random.default_rng(0), width=1.0, depth=0.8, height=0.2)
    other = make("step", np.random.default_rng(0), width=1.0, depth=1.0, height=0.45)
    # The first second stands on the floor before the block; then one foot after the other comes up onto it.
    t = np.arange(120)
    lift = np.stack([np.clip((t - a) / 20, 0, 1) * 0.2 for a in (30, 60)], axis=1)
    go = np.stack([np.clip((t - a) / 20, 0, 1) * 0.4 for a in (30, 60)], axis=1)
    ankles = forward_kinematics(hips, rotations)[0][:, [leg[2] for leg in FEET]]
    targets = ankles + np.stack((0 * lift, -go, lift), axis=-1)
    hips = hips + np.stack((0 * t, -go.mean(1), lift.mean(1) - 0.02), axis=1)
    rotations = place_limbs(hips, rotations, [leg[:3] for leg in FEET], targets)
    contacts = np.zeros((120, 5))
    contacts[:, FOOT_CONTACTS[0]] = (t < 30) | (t > 50)
    contacts[:, FOOT_CONTACTS[1]] = (t < 60) | (t > 80)
    pose = np.array((0.0, -0.5, 0.0, np.pi))  # its front edge lies 10 cm before the ankles
    pose[1] += ankles[0, 0, 1] + 0.0
    e = embed(hips, rotations, contacts, block, pose)
    assert e.touch[90:, FOOT_CONTACTS].all() and not e.touch[:30].any() and e.floor[:30].all()
    before = joints_of((hips, rotations))
    same = joints_of(transfer(e, block, pose))
    np.testing.assert_allclose(same, before, atol=2e-3)
    moved = joints_of(transfer(e, other, align(block, pose, other)))
    over = before[90:, FOOT_CONTACTS, 2] - 0.2  # of the ankles over the top
    np.testing.assert_allclose(moved[90:, FOOT_CONTACTS, 2], 0.45 + over, atol=0.01)
    assert over.mean() == pytest.approx(ANKLE_HEIGHT, abs=0.02)
    np.testing.assert_allclose(moved[:30, FOOT_CONTACTS], before[:30, FOOT_CONTACTS], atol=0.01)
    np.testing.assert_allclose(moved[100:, 0, 2] - before[100:, 0, 2], 0.25, atol=0.02)


def test_hands_reach_a_lower_box_by_leaning_and_bending_the_knees():
    hips, rotations = stand(90)
    crate = make("crate", np.random.default_rng(0), width=0.3, depth=0.3, height=0.3)
    pose = np.array((0.0, -0.42, 0.75, 0.0))  # on a table
    wrists = np.array(((-0.18, -0.34, 0.87), (0.18, -0.34, 0.87)))
    before = forward_kinematics(hips, rotations)[0][:, [arm[2] for arm in ARMS]]
    w = np.clip((np.arange(90) - 20) / 30, 0, 1)[:, None, None]
    rotations = place_limbs(hips, rotations, ARMS, before + w * (wrists - before))
    contacts = np.zeros((90, 5))
    contacts[:, FOOT_CONTACTS] = 1
    contacts[50:, HAND_CONTACTS[0]] = contacts[50:, HAND_CONTACTS[1]] = 1
    e = embed(hips, rotations, contacts, crate, pose)
    assert e.touch[50:, HAND_CONTACTS].all()
    low = pose - (0, 0, 0.6, 0)
    moved, old = joints_of(transfer(e, crate, low)), joints_of((hips, rotations))
    np.testing.assert_allclose(moved[50:, HAND_CONTACTS], old[50:, HAND_CONTACTS] - (0, 0, 0.6), atol=0.01)
    np.testing.assert_allclose(moved[:, FOOT_CONTACTS], old[:, FOOT_CONTACTS], atol=0.01)
    np.testing.assert_allclose(moved[:15], old[:15], atol=0.02)
