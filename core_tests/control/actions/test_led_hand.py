"""Hands that are led by planned poses: they rise before they come near, swing about shoulders that are as
high, and the wrist keeps to its way.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import ARMS, forward_kinematics
from nsm_core.control.actions.hold import SeenBody
from nsm_core.control.actions.led_hand import lead_to
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import matrix_from_forward_up
from nsm_core.world.scene.wrist import WristPose

TURN = matrix_from_forward_up(np.array((0, -1.0, 0)), np.array((0, 0, 1.0)))


@pytest.fixture(scope="module")
def stands() -> SeenBody:
    """One who stands as takes begin, with hanging arms."""
    stance = load_model(backend="numpy").metadata["stance"]
    local = np.array(stance["local_rotations"])
    hips = np.array((0.0, 0.0, stance["hips_height"]))
    return SeenBody(hips, local, forward_kinematics(hips, local)[0][[arm[2] for arm in ARMS]])


def low(stands: SeenBody, hand: int) -> WristPose:
    return WristPose(stands.wrists[hand] + (0.0, -0.5, 0.2), TURN)


def test_a_hand_rises_before_it_comes_near(stands):
    now, pose = stands.wrists[1], low(stands, 1)
    early, late = (lead_to(1, pose, stands, share).target for share in (0.3, 0.75))
    assert np.allclose(early[:2], now[:2]) and early[2] > now[2] + 0.05
    assert np.allclose(late[2], pose.place[2]) and 0.2 < (late - now)[1] / (pose.place - now)[1] < 0.9
    assert np.allclose(lead_to(1, pose, stands, 1.0).target, pose.place)


@pytest.mark.parametrize("hand", [0, 1])
@pytest.mark.parametrize("over", [-0.05, 0.1, 0.3])
def test_a_hand_keeps_off_its_shoulder(stands, hand, over):
    shoulder = stands.shoulders[hand]
    place = shoulder + (0.0, -0.35, over)
    ways = [lead_to(hand, WristPose(place, TURN), stands, share).target for share in np.linspace(0, 1, 21)]
    np.testing.assert_allclose((ways[0], ways[-1]), (stands.wrists[hand], place), atol=1e-9)
    assert np.linalg.norm(np.array(ways) - shoulder, axis=1).min() > 0.23
    assert np.linalg.norm(np.diff(ways, axis=0), axis=1).max() < 0.16, "and nowhere jumps"


def test_a_planned_hand_hardly_turns_about_what_it_holds(stands):
    grip = lead_to(0, low(stands, 0), stands, 1.0).grip
    assert grip is not None and 0 < grip.swivel < np.radians(15)
