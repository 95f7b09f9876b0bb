"""Rotations from places of joints."""

from __future__ import annotations

import numpy as np
from walks import seated_pose, synthetic_walk

from nsm_core.body.ik.pose_fit import pose_from_places
from nsm_core.body.interpolation import interpolated
from nsm_core.body.skeleton import ARMS, OFFSETS, forward_kinematics
from nsm_core.rotations import quat_from_axis_angle, quat_mul


def test_places_of_a_pose_are_met_from_another_pose():
    hips, local, _ = synthetic_walk(60)
    places = forward_kinematics(hips, local)[0]
    _, near = interpolated((hips[0], hips[-1]), (local[0], local[-1]), 58)
    found = pose_from_places(places[1:], near)
    assert np.abs(forward_kinematics(hips[1:], found)[0] - places[1:]).max() < 1e-6


def test_a_pose_is_found_again_from_itself():
    hips, local = seated_pose()
    places = forward_kinematics(hips[None], local[None])[0]
    found = pose_from_places(places, local[None])
    assert np.abs(np.abs((found[0] * local).sum(-1)) - 1).max() < 1e-9


def test_places_that_no_skeleton_has_are_come_near_to():
    hips, local = seated_pose()
    places = forward_kinematics(hips[None], local[None])[0]
    noisy = places + np.random.default_rng(0).normal(0, 0.01, places.shape)
    found = pose_from_places(noisy, local[None])
    off = np.linalg.norm(forward_kinematics(noisy[:, 0], found)[0] - noisy, axis=-1)
    assert np.isfinite(found).all() and off.max() < 0.08


def test_an_arm_that_bends_about_another_axis_than_its_hinge_is_not_twisted_onto_it():
    hips, local, _ = synthetic_walk(40)
    shoulder, elbow, _ = ARMS[0]
    bone = OFFSETS[elbow] / np.linalg.norm(OFFSETS[elbow])
    bent = quat_from_axis_angle(np.array((0.0, 0.0, 1.0)), np.linspace(0.8, 1.4, 40))
    against, back = (quat_from_axis_angle(bone, np.full(40, a)) for a in (0.5, -0.5))
    local[:, shoulder] = quat_mul(local[:, shoulder], against)
    local[:, elbow] = quat_mul(back, bent)
    places = forward_kinematics(hips, local)[0]
    near = interpolated((hips[0], hips[-1]), (local[0], local[-1]), 38)[1]
    found = pose_from_places(places[1:], near)
    for joint in (shoulder, elbow):
        turned = 2 * np.arccos(np.clip(np.abs((found[:, joint] * local[1:, joint]).sum(-1)), 0, 1))
        assert turned.max() < np.radians(3)
