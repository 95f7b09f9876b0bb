"""How far a take is the same where another library makes it; that it is the same to the bit where nothing
differs is looked at in ``test_take``, other kernels and versions of numpy in the goldens.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.take import roll
from nsm_core.evaluation.trials import climb
from nsm_core.model.inference.model import BUNDLED, load_model

# Metres between the joints of a take by numpy and of the same by torch; 0.005 mm were measured at most.
BOUND = 0.0001


@pytest.mark.skipif(not BUNDLED.exists(), reason="the bundled weights are missing")
def test_numpy_and_torch_make_the_same_take_within_a_tenth_of_a_millimetre():
    pytest.importorskip("torch")
    takes = [roll(load_model(backend=b), climb.request(climb.trials(1, 2)[1])) for b in ("numpy", "torch")]
    ours, theirs = (forward_kinematics(take.hips_position, take.local_rotations)[0] for take in takes)
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() < BOUND
    assert [goal.end_frame for goal in takes[0].goals] == [goal.end_frame for goal in takes[1].goals]
