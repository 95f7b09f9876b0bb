"""Poses of the network's states: elbows never bend backward."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import ARMS, HIPS, J, forward_kinematics
from nsm_core.control.posing import unbend_elbows
from nsm_core.evaluation.measures.motion import backward_bend
from nsm_core.rotations import quat_from_rotvec

HIPS_AT = np.array((0.0, 0.0, 0.95))


def bent(side: int, angle: float) -> np.ndarray:
    """A pose (23, 4) whose elbow is bent by ``angle`` radians, negative for backward."""
    local = np.tile((1.0, 0, 0, 0), (J, 1))
    local[HIPS] = quat_from_rotvec(np.array((0.1, 0.2, 0.3)))
    local[ARMS[side][0]] = quat_from_rotvec(np.array((0.3, -0.5, 0.2)))
    local[ARMS[side][1]] = quat_from_rotvec(np.array((0, 0, angle * (1 if side == 0 else -1))))
    return local


@pytest.mark.parametrize("side", [0, 1])
def test_elbows_that_bend_backward_are_straightened(side):
    local = bent(side, -0.25)
    assert backward_bend(HIPS_AT[None], local[None])["elbow_backward_deg"] == pytest.approx(
        np.degrees(0.25), abs=0.01
    )
    put_right = unbend_elbows(local)
    assert backward_bend(HIPS_AT[None], put_right[None])["elbow_backward_deg"] < 0.01
    joints = forward_kinematics(HIPS_AT, put_right)[0]
    start, elbow, wrist = joints[list(ARMS[side])]
    along = (elbow - start) / np.linalg.norm(elbow - start)
    assert (wrist - elbow) @ along == pytest.approx(np.linalg.norm(wrist - elbow), abs=1e-6)
    others = [j for j in range(J) if j != ARMS[side][1]]
    np.testing.assert_array_equal(put_right[others], local[others])


@pytest.mark.parametrize("side", [0, 1])
def test_elbows_that_bend_forward_are_left(side):
    local = bent(side, 0.4)
    np.testing.assert_array_equal(unbend_elbows(local), local)
