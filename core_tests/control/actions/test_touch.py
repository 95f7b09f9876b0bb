"""A hand on a point: what the shipped network and the reach make of it together."""

from __future__ import annotations

import numpy as np

from nsm_core.control.actions.touch import stand_of
from nsm_core.control.take import TakeRequest, roll
from nsm_core.evaluation.trials import touch
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import heading_to_direction


def test_a_point_on_a_front_is_touched_from_before_it():
    asked: TakeRequest = touch.request(touch.trials(1)[0], hold=0.3)
    goal = asked.goals[0]
    stand, heading = stand_of(goal)
    assert 0.4 < (goal.position[:2] - stand) @ heading_to_direction(np.array(heading)) < 0.6
    done = roll(load_model(), asked).goals[0]
    assert done.reached and done.hand_error_cm < 3 < 20 < done.network_hand_error_cm
