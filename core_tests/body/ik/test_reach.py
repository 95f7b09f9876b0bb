"""Bodies come within reach of what their limbs are to touch, by the least and without a jump."""

from __future__ import annotations

import captures
import numpy as np

from nsm_core.body.ik.reach import EXACT, bending, into_reach, leaning, shifting, sinking
from nsm_core.body.skeleton import ARMS, FEET, HIPS, INDEX, forward_kinematics

SHOULDERS = [arm[0] for arm in ARMS]
LEGS = [leg[:3] for leg in FEET]
REACH = 0.5


def low_places(count: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A stand, and places (T, 2, 3) before it that come out of reach in the middle."""
    hips, local = captures.stand(count)
    down = 0.5 * np.sin(np.pi * np.arange(count) / (count - 1)) ** 2
    shoulders = forward_kinematics(hips, local)[0][:, SHOULDERS]
    return hips, local, shoulders + (0, -0.25, -0.3) - down[:, None, None] * (0, 0, 1)


def away(hips, local, places) -> np.ndarray:
    return np.linalg.norm(forward_kinematics(hips, local)[0][:, SHOULDERS] - places, axis=-1)


def test_what_reaches_is_returned_as_it_is():
    hips, local, places = low_places()
    assert all(
        a is b
        for a, b in zip(into_reach(hips, local, ARMS, places, 9.0, bending()), (hips, local), strict=True)
    )


def test_shoulders_come_within_reach_smoothly_and_no_nearer():
    hips, local, places = low_places()
    before = away(hips, local, places)
    assert before.max() > REACH + 0.2 and before[0].max() < REACH
    for gives in (bending(), shifting()):
        exact = into_reach(hips, local, ARMS, places, REACH, gives, EXACT)
        assert away(*exact, places).max() < REACH + 0.003
        smooth = into_reach(hips, local, ARMS, places, REACH, gives)
        assert away(*smooth, places).max() < REACH + 0.02
        joints = forward_kinematics(*smooth)[0]
        assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.05
        assert away(*exact, places)[25:35].min() > REACH - 0.02


def test_what_is_to_stay_stays():
    hips, local, places = low_places()
    near = places + (0, 0, 0.25)
    moved, leant = into_reach(hips, local, ARMS, near, REACH, leaning(), EXACT)
    np.testing.assert_array_equal(moved, hips)
    np.testing.assert_array_equal(leant[:, HIPS], local[:, HIPS])
    assert away(moved, leant, near).max() < REACH + 0.003 and away(hips, local, near).max() > REACH + 0.05
    feet = forward_kinematics(hips, local)[0][:, [leg[2] for leg in LEGS]] - (0, 0, 0.05)
    reach = np.linalg.norm(
        feet + (0, 0, 0.05) - forward_kinematics(hips, local)[0][:, [leg[0] for leg in LEGS]], axis=-1
    )
    sunk, same = into_reach(hips, local, LEGS, feet, reach, sinking(), EXACT)
    np.testing.assert_allclose(sunk - hips, np.broadcast_to((0, 0, -0.05), hips.shape), atol=3e-3)
    np.testing.assert_allclose(np.abs((same * local).sum(-1)), 1, atol=1e-9)


def test_hips_go_with_one_foot_that_is_far():
    hips, local = captures.stand(20)
    joints = forward_kinematics(hips, local)[0]
    far = joints[:, [leg[2] for leg in LEGS]].copy()
    far[:, 0, 0] -= 0.4
    moved, turned = into_reach(hips, local, LEGS, far, 0.8, shifting(), EXACT)
    starts = forward_kinematics(moved, turned)[0][:, [INDEX["RightHip"], INDEX["LeftHip"]]]
    assert np.linalg.norm(starts - far, axis=-1).max() < 0.803
