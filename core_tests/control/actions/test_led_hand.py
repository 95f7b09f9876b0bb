"""Hands that are led by planned poses: they rise before they come near, and the wrist keeps to its way."""

from __future__ import annotations

import numpy as np

from nsm_core.control.actions.led_hand import lead_to
from nsm_core.rotations import matrix_from_forward_up
from nsm_core.world.scene.wrist import WristPose

HANGING = np.array((0.2, -0.1, 0.85))
POSE = WristPose(
    np.array((0.3, -0.6, 1.1)), matrix_from_forward_up(np.array((0, -1.0, 0)), np.array((0, 0, 1.0)))
)


def test_a_hand_rises_before_it_comes_near():
    early, late = (lead_to(1, POSE, HANGING, share).target for share in (0.3, 0.75))
    assert np.allclose(early[:2], HANGING[:2]) and early[2] > HANGING[2] + 0.05
    assert np.allclose(late[2], POSE.place[2]) and 0.2 < (late - HANGING)[1] / (POSE.place - HANGING)[1] < 0.9
    assert np.allclose(lead_to(1, POSE, HANGING, 1.0).target, POSE.place)


def test_a_planned_hand_hardly_turns_about_what_it_holds():
    grip = lead_to(0, POSE, HANGING, 1.0).grip
    assert 0 < grip.swivel < np.radians(15)
