"""Hands come out of solids smoothly, and free hands are left alone."""

from __future__ import annotations

import numpy as np
from walks import synthetic_walk

from nsm_core.body.ik.hand_clearance import FURTHEST, HandClearance
from nsm_core.body.skeleton import ARMS, INDEX, forward_kinematics
from nsm_core.world.geometry.distance import Cuboids


def standing() -> tuple[np.ndarray, np.ndarray]:
    hips, local, _ = synthetic_walk(1, speed=0.0)
    return hips[0], local[0]


def slab_under(point: np.ndarray, depth: float) -> Cuboids:
    """A slab whose top lies ``depth`` metres over ``point``."""
    low, high = point + (-0.3, -0.3, -0.2), point + (0.3, 0.3, depth)
    return Cuboids([(np.zeros(3), 0.0, low[None], high[None])])


def test_free_hands_stay():
    hips, local = standing()
    assert np.array_equal(HandClearance(Cuboids()).apply(hips, local), local)


def test_a_hand_in_a_slab_comes_out_without_a_jump_and_the_rest_stays():
    hips, local = standing()
    positions, _ = forward_kinematics(hips, local)
    query = slab_under(
        positions[ARMS[0][2]], 0.04
    )  # the arms are held out to the sides; the right hand lies in the slab
    hands = HandClearance(query)
    places = [forward_kinematics(hips, hands.apply(hips, local))[0] for _ in range(40)]
    start = HandClearance(query)._probe(hips.astype(float), local.astype(float))[1][0]
    end = hands._probe(hips.astype(float), local.astype(float))[1][0]

    def deep(points):
        return -query.signed_distance(points.astype(np.float32), 0.1).min()

    assert deep(start) > 0.03 and deep(end) < 0.005
    moves = np.linalg.norm(np.diff([p[INDEX["RightWrist"]] for p in places], axis=0), axis=1)
    assert moves.max() < 0.025
    others = [INDEX["LeftToe"], INDEX["Head"], INDEX["RightElbow"] + 3]
    assert np.allclose(places[-1][others], positions[others])


def test_push_is_limited_and_fades():
    hips, local = standing()
    wrist = forward_kinematics(hips, local)[0][ARMS[1][2]]
    hands = HandClearance(slab_under(wrist, 0.6))
    for _ in range(60):
        moved = forward_kinematics(hips, hands.apply(hips, local))[0][ARMS[1][2]]
    assert np.linalg.norm(moved - wrist) < FURTHEST + 0.01
    hands.query = Cuboids()
    for _ in range(60):
        local_after = hands.apply(hips, local)
    assert np.allclose(local_after, local)


def test_a_hand_that_holds_stays_and_each_hand_may_have_its_own_solids():
    hips, local = standing()
    wrists = forward_kinematics(hips, local)[0][[arm[2] for arm in ARMS]]
    both = Cuboids()
    both.groups = slab_under(wrists[0], 0.04).groups + slab_under(wrists[1], 0.04).groups

    def moved(**more):
        return [
            float(np.linalg.norm(forward_kinematics(hips, out)[0][arm[2]] - wrists[k]))
            for out in [run_hands(both, hips, local, **more)]
            for k, arm in enumerate(ARMS)
        ]

    right, left = moved()
    assert right > 0.02 and left > 0.02
    right, left = moved(held=(1.0, 0.0))
    assert right < 1e-3 and left > 0.02
    right, left = moved(queries=(both, Cuboids()))
    assert right > 0.02 and left < 1e-3


def run_hands(query: Cuboids, hips: np.ndarray, local: np.ndarray, **more) -> np.ndarray:
    hands = HandClearance(query)
    for _ in range(30):
        out = hands.apply(hips, local, **more)
    return out
