"""Manners of sitting in takes: hands on thighs or arm rests, other for other seeds, none of it standing."""

from __future__ import annotations

import numpy as np
import pytest
from walks import seated_pose

from nsm_core.body.capsules import BUNDLED
from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import ARMS, FEET, OFFSETS, J
from nsm_core.body.tree import HUMAN
from nsm_core.control.actions.seat_manner import SeatedManner, draw_seated
from nsm_core.control.hands import hands_of
from nsm_core.control.seated import sat
from nsm_core.rotations import quat_slerp, rotate_planar
from nsm_core.signals import smooth_step
from nsm_core.world.affordances.arm_rests import arm_rests, arm_rests_beside
from nsm_core.world.scene import furniture

COUNT = 120


def sitter() -> tuple[Pose, np.ndarray]:
    """Who stands, sits down, stays and rises again; and how far it is down (T,)."""
    hips, local = seated_pose()
    n = np.arange(COUNT)
    down = smooth_step(np.clip(np.minimum(n - 15, COUNT - 16 - n) / 20, 0, 1))
    straight = np.zeros((J, 4))
    straight[:, 0] = 1
    high = hips * (1, 1, 0) + (0, 0, OFFSETS[0, 2])
    return (
        Pose(
            HUMAN,
            high + down[:, None] * (hips - high),
            np.stack([quat_slerp(straight, local, np.full(J, w)) for w in down]),
        ),
        down,
    )


def acted(manner: SeatedManner) -> tuple[Pose, np.ndarray, list]:
    pose, down = sitter()
    kept, leads = sat(pose, [manner if w > 0.5 else None for w in down], BUNDLED)
    hands = hands_of(leads, kept, BUNDLED)
    return Pose(HUMAN, kept.hips, hands.led(kept, hands.firm, hands.turns)), down, leads


@pytest.mark.parametrize("lap", (False, True))
def test_hands_lie_over_the_thighs_while_one_sits_and_are_free_otherwise(lap):
    place = (0.6, 0.02)
    pose, down, leads = acted(SeatedManner(True, lap, place, (0.0, 0.55), (0.45, 1.0), 0.0))
    joints = pose.positions[COUNT // 2]
    for arm, leg in zip(ARMS, FEET, strict=True):
        thigh = joints[leg[1]] - joints[leg[0]]
        along = float((joints[arm[2]] - joints[leg[0]]) @ thigh / (thigh @ thigh))
        over = joints[arm[2], 2] - (joints[leg[0]] + along * thigh)[2]
        assert 0.06 < over < 0.13 and along == pytest.approx(0.3 if lap else 0.6, abs=0.1)
    assert not any(leads[t] for t in np.flatnonzero(down == 0))


def test_the_trunk_leans_with_the_seat_alone_and_the_head_looks_on():
    pose, down, _ = acted(SeatedManner(False, False, (0.5, 0.0), (0.0, 0.5), (0.0, 0.5), np.radians(10)))
    own = sitter()[0]
    np.testing.assert_allclose(pose.local[down == 0], own.local[down == 0], atol=1e-3)
    chest, head = (
        np.degrees(2 * np.arccos(np.clip(np.abs((pose.world[60, j] * own.world[60, j]).sum()), 0, 1)))
        for j in (4, 6)
    )
    assert chest == pytest.approx(10, abs=1) and head < 7


def test_seeds_sit_in_other_manners():
    made = [acted(draw_seated(np.random.default_rng(seed), True))[0].positions[60] for seed in range(6)]
    apart = [np.linalg.norm(a - b, axis=-1).max() for k, a in enumerate(made) for b in made[:k]]
    assert min(apart) > 0.01 and max(apart) > 0.1
    again = acted(draw_seated(np.random.default_rng(3), True))[0].positions[60]
    np.testing.assert_array_equal(again, made[3])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ("armchair", "chair", "stool"))
def test_rests_are_found_by_the_surface_where_the_piece_has_them(kind, seed):
    piece = furniture.make(kind, np.random.default_rng(seed))
    turn, at = 0.7, np.array((1.0, 2.0))
    seat = piece.require_seat()
    known = [
        None if r is None else np.append(rotate_planar(r[:2], np.float64(turn)) + at, r[2])
        for r in arm_rests(piece)
    ]
    hips = np.append(rotate_planar(seat.point[:2], np.float64(turn)) + at, seat.height + 0.08)
    solids = furniture.cuboids([(piece, np.append(at, 0), turn)])
    found = arm_rests_beside(solids, hips, seat.heading + turn)
    for one, other in zip(found, known, strict=True):
        assert (one is None) == (other is None), (found, known)
        if one is not None:
            assert abs(one[2] - other[2]) < 0.015 and np.linalg.norm(one - other) < 0.12


def test_hands_lie_on_rests_where_there_are_some():
    rest = np.array((0.3, -0.15, 0.68))
    hips = sitter()[0].hips[60]
    place = hips * (1, 1, 0) + rest
    manner = SeatedManner(True, True, (0.5, 0.0), (0.0, 0.55), (0.0, 0.55), 0.0, (None, place))
    pose = acted(manner)[0].positions[60]
    assert np.linalg.norm(pose[ARMS[1][2]] - place) < 0.05
    assert np.linalg.norm(pose[ARMS[0][2]] - place) > 0.3, "the other hand lies on its thigh"
