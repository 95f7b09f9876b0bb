"""How gaps are drawn: which windows, and how fast they are played."""

from __future__ import annotations

import numpy as np
from gaps_of_walks import windows

from nsm_core.body.skeleton import HIPS
from nsm_core.data.transitions.gaps import PACES, GapSource
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES


def test_rare_paces_are_drawn_as_often_as_others_where_that_is_asked():
    cut = windows()
    pace = np.searchsorted(PACES, cut.speeds(), side="right")
    assert len(set(pace)) > 1
    for evened, held in ((0.0, False), (1.0, False), (1.0, True)):
        shares = GapSource(cut, held, True, evened).shares
        of_each = [shares[pace == kind].sum() for kind in set(pace)]
        if evened:
            assert np.allclose(of_each, of_each[0])
        else:
            assert np.allclose(shares, shares[0])


def test_windows_are_played_faster_and_slower_from_the_same_frame():
    source, frames = GapSource(windows(), False, True), 10
    chosen = windows().chosen(False, 2 * (PAST + frames + TARGET_FRAMES))[:1]
    none = np.zeros(1, int)

    def way(rate):
        return source.gaps(frames, chosen, none, none, np.zeros(1), none.astype(bool), rate).joints[
            0, :, HIPS
        ]

    usual, same, half = way(None), way(np.ones(1)), way(np.full(1, 0.5))
    assert np.allclose(usual, same, atol=1e-5)
    gone = [np.linalg.norm(w[-1, :2] - w[0, :2]) for w in (usual, half)]
    assert np.isclose(gone[1] / gone[0], 0.5, atol=0.05)


def test_hasted_gaps_stay_in_their_windows():
    source = GapSource(windows(), False, True, hasted=0.5)
    plain = GapSource(windows(), False, True)
    drawn = [s.draw(30, 64, np.random.default_rng(1)).joints for s in (source, plain)]
    speeds = [np.linalg.norm(np.diff(j[:, :, HIPS], axis=1), axis=-1).mean(1) for j in drawn]
    assert np.isfinite(drawn[0]).all() and speeds[0].std() > speeds[1].std()
    assert speeds[0].max() < 1.6 * speeds[1].max()
