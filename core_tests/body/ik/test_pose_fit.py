"""Rotations from places of joints."""

from __future__ import annotations

import numpy as np
from walks import seated_pose, synthetic_walk

from nsm_core.body.ik.pose_fit import pose_from_places
from nsm_core.body.interpolation import interpolated
from nsm_core.body.skeleton import forward_kinematics


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
