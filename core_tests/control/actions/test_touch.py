"""A hand on a point: what the shipped network and the reach make of it together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.body.skeleton import ARMS, END_SITES, JOINTS, forward_kinematics
from nsm_core.control.actions.touch import stand_of
from nsm_core.control.take import TakeRequest, roll
from nsm_core.evaluation.trials import touch
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import heading_to_direction, quat_rotate


def test_a_point_on_a_front_is_touched_from_before_it():
    asked: TakeRequest = touch.request(touch.trials(1)[0], hold=0.3)
    goal = asked.goals[0]
    stand, heading = stand_of(goal)
    assert 0.4 < (goal.position[:2] - stand) @ heading_to_direction(np.array(heading)) < 0.6
    take = roll(load_model(), asked)
    done = take.goals[0]
    assert done.reached and done.hand_error_cm < 1 < 20 < done.network_hand_error_cm
    hand, after = done.taken.hands[0], slice(done.taken.frame, None)
    joints, turns = (
        a[after, ARMS[hand][2]] for a in forward_kinematics(take.hips_position, take.local_rotations)
    )
    tips = joints + quat_rotate(turns, np.array(END_SITES[JOINTS[ARMS[hand][2]]]))
    assert np.linalg.norm(tips - goal.position, axis=1).max() < 0.03


def test_without_ik_the_hand_is_as_far_off_as_the_network_has_it():
    asked = replace(touch.request(touch.trials(1)[0], hold=0.3), contact_ik=False)
    take = roll(load_model(), asked)
    done = take.goals[0]
    np.testing.assert_array_equal(take.local_rotations, take.network_rotations)
    assert done.hand_error_cm > 20
    # The network's joints and those that its rotations lead to are not the same to the centimetre.
    np.testing.assert_allclose(done.hand_error_cm, done.network_hand_error_cm, atol=2)
