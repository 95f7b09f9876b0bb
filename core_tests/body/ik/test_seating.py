"""Hips settle on a seat within half a second of touching it, turn to it, and are let go smoothly."""

from __future__ import annotations

import numpy as np
from walks import seated_pose

from nsm_core.body.ik.seating import DRAW_TIME, HIP_PLAY, NEXT_SEAT, settle
from nsm_core.conventions import FPS

T = 90


def sitter(off=(0.06, 0.04, 0.03)):
    hips, local = seated_pose()
    hips = np.repeat(hips.astype(np.float64)[None] + off, T, 0)
    return hips, np.repeat(local.astype(np.float64)[None], T, 0)


def test_hips_come_to_the_seat_and_are_let_go():
    hips, local = sitter()
    seat = hips[0] - (0.06, 0.04, 0.03)
    labels = np.zeros(T)
    labels[10:60] = 1.0
    kept, turned, weight = settle(hips, local, np.zeros(T), labels, [(seat, 0.0)] * T)
    far = np.linalg.norm(kept - seat, axis=1)
    settled = 10 + round(DRAW_TIME * FPS)
    assert np.allclose(kept[:10], hips[:10]) and far[settled:60].max() < HIP_PLAY + 1e-6
    assert np.allclose(kept[60 + round(DRAW_TIME * FPS) :], hips[-1])
    assert np.linalg.norm(np.diff(kept, axis=0), axis=1).max() < 0.012
    assert weight.max() == 1 and weight[0] == 0


def test_the_body_turns_to_the_seat_but_is_not_twisted_round():
    hips, local = sitter()
    seat = hips[0].copy()
    near, _, _ = settle(hips, local, np.full(T, np.radians(10)), np.ones(T), [(seat, 0.0)] * T)[1], 0, 0
    far = settle(hips, local, np.full(T, np.radians(60)), np.ones(T), [(seat, 0.0)] * T)[1]
    still = settle(hips, local, np.full(T, np.radians(10)), np.ones(T), [(seat, None)] * T)[1]
    turn = 2 * np.degrees(np.arccos(np.clip(np.abs((near[-1, 0] * local[-1, 0]).sum()), 0, 1)))
    assert 9 < turn < 10.1
    assert np.allclose(far, local) and np.allclose(still, local)


def test_who_is_sent_to_the_next_seat_is_let_go_first():
    hips, local = sitter((0.0, 0.0, 0.0))
    seat = hips[0].copy()
    other = seat + (4 * NEXT_SEAT, 0, 0)
    goals = [(seat, 0.0)] * 45 + [(other, 0.0)] * 45
    kept = settle(hips, local, np.zeros(T), np.ones(T), goals)[0]
    assert np.linalg.norm(np.diff(kept, axis=0), axis=1).max() < 0.02
    assert np.linalg.norm(kept[-1] - other) < HIP_PLAY + 1e-6
