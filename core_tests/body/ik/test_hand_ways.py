"""Ways of hands: over the edge before them, round the corners of a box, and straight where nothing is in the
way.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.ik.hand_clearance import HandClearance
from nsm_core.body.ik.hand_ways import HandWays
from nsm_core.body.ik.reaching import Pose
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ARMS, J
from nsm_core.rotations import quat_from_rotvec
from nsm_core.world.geometry.distance import Cuboids


def hanging(wrists: np.ndarray) -> Pose:
    """One who stands at the origin facing -Y with hanging arms, wrists at ``wrists`` (2, 3), fingers down."""
    local = np.zeros((J, 4))
    local[:, 0] = 1
    for arm, sign in zip(ARMS, (-1.0, 1.0), strict=True):
        local[arm[0]] = quat_from_rotvec(np.array((0, sign * 1.4, 0)))
    hips = np.array((0.0, 0.0, 0.93))
    return Pose(hips, place_limbs(hips, local, ARMS, wrists), wrists)


def solid(low, high) -> Cuboids:
    return Cuboids([((0, 0, 0), 0.0, np.array((low,), float), np.array((high,), float))])


FROM = np.array(((-0.22, -0.2, 0.95), (0.22, -0.2, 0.95)))
CABINET = solid((-0.6, -1.0, 0.0), (0.6, -0.27, 0.9))
CRATE = solid((-0.3, -1.0, 0.6), (0.3, -0.27, 1.2))


def way(solids, to, back=False):
    """Wrists (T, 2, 3) that go to ``to`` (2, 3) in 24 frames, waiting as told, or back from it, and how deep
    fingers were.
    """
    pose, ways, share, points, deep = hanging(FROM), HandWays([0, 1]), 1.0 if back else 0.0, [], []
    now = pose.arms()[1]
    for _ in range(200):
        share = float(np.clip(share + (-1 if back else 1) * ways.ready / 24, 0, 1))
        off = ways.off_the_line(pose.hips, pose.local, now, to, share, to, solids, back)
        points.append(now + share * (to - now) + off)
        tips = points[-1] - (0, 0, 0.15)
        if solids is not None and share < 0.8:
            deep.append(
                -float(
                    solids.signed_distance(np.concatenate((points[-1], tips)).astype(np.float32), 0.2).min()
                )
            )
        if share in (0.0, 1.0):
            break
    return np.array(points), max(deep, default=0.0)


@pytest.mark.parametrize("back", [False, True])
def test_hands_go_over_an_edge(back):
    to = np.array(((-0.2, -0.5, 1.05), (0.2, -0.5, 1.05)))
    points, deep = way(CABINET, to, back)
    assert deep < 0.03 and way(None, to, back)[1] == 0.0
    assert points[:, :, 2].max() > 1.08  # over the straight way
    assert np.abs(points[-1] - (FROM if back else to)).max() < 0.06
    assert np.abs(np.diff(points, axis=0)).max() < 0.09


def test_hands_go_round_the_corners_of_a_box():
    to = np.array(((-0.33, -0.6, 0.95), (0.33, -0.6, 0.95)))
    points, deep = way(CRATE, to)
    assert deep < 0.02 and points[:, 0, 0].min() < -0.34 and points[:, 1, 0].max() > 0.34
    np.testing.assert_allclose(points[-1], to, atol=1e-9)


def test_hands_go_straight_where_nothing_is_in_the_way():
    to = np.array(((-0.2, -0.5, 1.05), (0.2, -0.5, 1.05)))
    np.testing.assert_allclose(way(solid((5, 5, 0), (6, 6, 1)), to)[0], way(None, to)[0], atol=1e-9)


def test_fingers_stay_turned_up_after_letting_go_until_nothing_is_under_them():
    top, hands = solid((-1, -1.0, 0.0), (1, -0.1, 0.86)), HandClearance(solid((5, 5, 0), (6, 6, 1)))
    pose, raised = hanging(FROM + (0, 0, 0.02)), []
    for k in range(80):
        hands.apply(
            pose.hips, pose.local, (1.0, 1.0) if k < 40 else (0.0, 0.0), (top, top) if k < 50 else None
        )
        raised.append(hands._raised.min())
    assert raised[39] > 0.3 and raised[49] > 0.3 and raised[-1] == 0
    assert np.abs(np.diff(raised)).max() < 0.17
