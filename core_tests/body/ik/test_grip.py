"""Hands that lie on the sides of a thing: palms on it, fingers ahead, wrists bent no more than need be."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.ik.grip import MOST_BEND, MOST_TWIST, laid, twist_of, within
from nsm_core.rotations import quat_conjugate, quat_from_rotvec, quat_mul, quat_rotate, quat_to_rotvec

AHEAD, RIGHT, DOWN = np.array(((0.0, -1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
TIPS = {0: (-1.0, 0.0, 0.0), 1: (1.0, 0.0, 0.0)}  # where fingers point in the T-pose, right and left


def held(side: int, forearm, lowest: float = 1.0) -> dict[str, np.ndarray]:
    """Where palm, fingers and thumb of a hand point on the side of a box that its carrier has ahead."""
    palm = RIGHT if side else -RIGHT
    way = np.asarray(forearm, dtype=float) / np.linalg.norm(forearm)
    turn = laid(palm[None], AHEAD[None], way[None], side, np.array([lowest]))[0]
    tips = {"palm": DOWN, "fingers": TIPS[side], "thumb": AHEAD}
    return {name: quat_rotate(turn, np.asarray(tip)) for name, tip in tips.items()}


@pytest.mark.parametrize("side", [0, 1])
def test_palms_lie_on_the_sides_with_thumbs_up(side):
    hand = held(side, AHEAD)
    assert hand["palm"] == pytest.approx(RIGHT if side else -RIGHT, abs=1e-6)
    assert hand["fingers"] == pytest.approx(AHEAD, abs=1e-6) and hand["thumb"][2] == pytest.approx(1)


@pytest.mark.parametrize("side", [0, 1])
def test_fingers_turn_down_to_a_forearm_that_hangs_and_not_into_the_floor(side):
    steep = np.degrees(np.arcsin(-held(side, AHEAD + 1.7 * DOWN)["fingers"][2]))  # a forearm 60 degrees down
    assert 30 < steep < 45
    assert -held(side, AHEAD + 1.7 * DOWN, 0.2)["fingers"][2] == pytest.approx(0.2)
    assert held(side, AHEAD - 1.7 * DOWN, 0.2)["fingers"][2] > 0.5  # upward nothing is in the way
    straight = held(side, RIGHT if side else -RIGHT)  # a forearm that comes straight at the palm
    assert straight["fingers"] == pytest.approx(AHEAD, abs=1e-6)


def test_a_hand_swivels_no_more_than_it_may():
    def swivelled(most):
        turn = laid(DOWN[None], AHEAD[None], RIGHT[None], 1, np.ones(1), most)[0]
        return float(np.degrees(np.arccos(np.clip(quat_rotate(turn, np.array(TIPS[1])) @ AHEAD, -1, 1))))

    assert swivelled(np.inf) == pytest.approx(68, abs=1) and swivelled(0.5) == pytest.approx(
        np.degrees(0.5), abs=0.1
    )


def test_wrists_stay_within_what_a_person_does():
    rng = np.random.default_rng(4)
    forearms, turns = quat_from_rotvec(rng.normal(0, 1, (40, 3))), rng.normal(0, 1.2, (40, 3))
    hands = quat_mul(forearms, quat_from_rotvec(turns))
    kept = quat_mul(quat_conjugate(forearms), within(hands, forearms))
    twist = twist_of(kept)
    bend = np.linalg.norm(
        quat_to_rotvec(quat_mul(kept, quat_from_rotvec(-twist[:, None] * np.eye(3)[0]))), axis=1
    )
    assert np.abs(twist).max() <= MOST_TWIST + 1e-6 and bend.max() <= MOST_BEND + 1e-6
    small = quat_mul(forearms, quat_from_rotvec(0.2 * turns))
    assert np.abs((within(small, forearms) * small).sum(1)) == pytest.approx(np.ones(40), abs=1e-3)
