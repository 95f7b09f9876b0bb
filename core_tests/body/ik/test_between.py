"""Motions between two others that stay: feet that are let glide stand."""

from __future__ import annotations

import numpy as np
from walks import synthetic_walk

from nsm_core.body.contacts import TOES
from nsm_core.body.ik.between import ENDS, planted
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.conventions import FPS


def test_feet_that_glide_while_they_ought_to_stand_do_stand():
    hips, local, _ = synthetic_walk(60)
    hips, local = hips.astype(np.float64), local.astype(np.float64)
    before = forward_kinematics(hips, local)[0][:, TOES]
    pace = np.linalg.norm(np.diff(before[..., :2], axis=0), axis=-1) * FPS
    stands = (pace < 0.2) & (before[1:, :, 2] < 0.05)
    # The whole glides on, by more than feet do that rest.
    hips[:, 1] -= np.arange(60) * 0.45 / FPS
    made = forward_kinematics(*planted(hips, local))[0][:, TOES]
    inside = slice(ENDS + 6, -ENDS - 6)
    slid = np.linalg.norm(np.diff(made[..., :2], axis=0), axis=-1)[inside][stands[inside]] * FPS
    assert stands[inside].mean() > 0.3 and np.median(slid) < 0.05
