"""Heels rise where a seat is high, so that knees stay over its level; elsewhere nothing changes."""

from __future__ import annotations

import numpy as np

from nsm_core.body.ik.heels import KNEE_OVER_SEAT, Heels
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import FEET, HIP_OVER_SEAT, J, forward_kinematics

LEGS = tuple(leg[:3] for leg in FEET)


def seated(height: float) -> tuple[np.ndarray, np.ndarray]:
    """Hips and local rotations of someone who sits at a height of the seat, feet flat before it."""
    hips = np.array((0.0, 0.0, height + HIP_OVER_SEAT))
    local = np.zeros((J, 4))
    local[:, 0] = 1
    ankles = np.array(((-0.1, -0.42, 0.085), (0.1, -0.42, 0.085)))
    return hips, place_limbs(hips, local, LEGS, ankles, np.tile((1.0, 0, 0, 0), (2, 1)))


def settle(hips: np.ndarray, local: np.ndarray, frames: int = 60) -> np.ndarray:
    heels = Heels()
    before = local
    for _ in range(frames):
        kept = heels.apply(hips, local, 1.0, hips)
        joints, last = (forward_kinematics(hips, r)[0] for r in (kept, before))
        assert np.linalg.norm(joints - last, axis=-1).max() < 0.03  # no pop
        before = kept
    return kept


def test_knees_stay_over_a_high_seat_and_toes_where_they_are():
    hips, local = seated(0.53)
    knees, toes = [leg[1] for leg in FEET], [leg[3] for leg in FEET]
    before = forward_kinematics(hips, local)[0]
    assert (before[knees, 2] < 0.53).all()
    after = forward_kinematics(hips, settle(hips, local))[0]
    # As far as the foot can lift it.
    assert (after[knees, 2] > 0.53 + 0.5 * KNEE_OVER_SEAT).all() and (
        after[knees, 2] < 0.53 + KNEE_OVER_SEAT + 0.01
    ).all()
    np.testing.assert_allclose(after[toes], before[toes], atol=1e-4)


def test_low_seats_and_standing_change_nothing():
    hips, local = seated(0.40)
    np.testing.assert_array_equal(settle(hips, local), local)
    hips, local = seated(0.53)
    heels = Heels()
    for seat, label in ((None, 1.0), (hips, 0.0)):
        for _ in range(10):
            np.testing.assert_array_equal(heels.apply(hips, local, label, seat), local)
