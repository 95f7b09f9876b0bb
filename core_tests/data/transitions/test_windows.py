"""Captures cut into windows, ground fitted under each, some actors kept out."""

from __future__ import annotations

import numpy as np
import pytest
from gaps_of_walks import walk, windows

from nsm_core.data.transitions.actors import HELD_OUT, actor_of, held_out
from nsm_core.data.transitions.fitting import CONTACTS, KEPT, cost, feet_of, fitted
from nsm_core.data.transitions.ground import DEVIATION, Grounds, gaussian, logistic, looked_up
from nsm_core.data.transitions.heightmaps import CELL, KINDS, SIDE, heightmaps
from nsm_core.data.transitions.windows import Windows, clips_of, cut
from nsm_core.errors import CaptureError


def test_an_actor_is_a_folder_or_a_subject_in_it():
    assert actor_of("cmu/cmu_07_01") == "cmu_07" and actor_of("sets/uiprmd/uiprmd_s01_sit_02") == "uiprmd_s01"
    assert actor_of("accad_male1/male1_b3_walk") == "accad_male1" and actor_of("alone") == "alone"


def test_a_fifth_of_all_frames_is_held_out_and_never_all():
    frames = {"accad_male2": 10, "cmu_01": 300, "cmu_05": 100, "cmu_06": 90}
    assert "accad_male2" in HELD_OUT and held_out(frames) == ("accad_male2", "cmu_06")
    assert held_out({"one": 5}) == () and held_out({"a": 1, "b": 99}) == ("b",)


def test_ground_is_made_alike_every_time_and_repeats():
    maps = heightmaps(2)
    assert np.array_equal(maps, heightmaps(2)) and len(maps) == 1 + 2 * len(KINDS) and not maps[0].any()
    assert all(0.1 < np.ptp(m) < 3.5 for m in maps[1:])
    which, none, places = (
        np.arange(len(maps)),
        np.zeros(len(maps)),
        np.random.default_rng(0).uniform(0, 9, (7, 2)),
    )
    places = np.broadcast_to(places, (len(maps), 7, 2))
    shift = np.zeros((len(maps), 2))
    here = looked_up(maps, which, none, shift, places)
    assert np.allclose(here, looked_up(maps, which, none, shift + SIDE * CELL, places), atol=2e-3)
    assert np.allclose(here, looked_up(maps, which, none + 0.7, shift, turned(places, -0.7)), atol=2e-3)


def turned(places: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return places @ np.array(((c, s), (-s, c)))


def test_kernel_and_filter_are_one_in_the_middle_and_fade():
    x = np.linspace(0, 2, 50)
    for kernel in (logistic, gaussian):
        values = kernel(x, 0 * x)
        assert values[0] == 1 and (np.diff(values) <= 0).all() and values[-1] < 0.01
    assert np.isclose(gaussian(np.array(DEVIATION), np.array(0.0)), np.exp(-0.5))
    assert (
        gaussian(np.array(16.5 * CELL), np.array(0.0)) == 0 < gaussian(np.array(15.5 * CELL), np.array(0.0))
    )


def test_ground_is_bent_to_the_feet_that_stand_on_it():
    positions = walk(80).world()[0].astype(np.float64)
    positions[..., 2] -= 0.2 * positions[..., 1]  # uphill
    maps, feet = heightmaps(2), feet_of(positions)
    ground = fitted(positions, maps, np.random.default_rng(1))
    assert len(ground.map) == KEPT == len(set(ground.map.tolist()))
    assert feet.touch.any(0).all() and 4 <= len(feet.stands) <= CONTACTS

    def judged(of: Grounds) -> np.ndarray:
        flat = np.broadcast_to(feet.points[..., :2].reshape(-1, 2), (KEPT, feet.touch.size, 2))
        return cost(of.height(maps, flat).reshape(KEPT, *feet.touch.shape), feet)

    plain = ground[:]
    plain.radial, plain.filtered = ground.radial * 0, ground.filtered * 0
    without_filter = ground[:]
    without_filter.filtered = ground.filtered * 0
    assert (judged(ground) <= judged(without_filter) + 1e-12).all()
    assert judged(ground).max() < 0.03**2 and judged(ground).mean() < judged(plain).mean() / 2


def test_windows_are_cut_and_kept(tmp_path):
    found = windows()
    assert found.about["held_out"] == ["two_02", "two_03"] or found.about["held_out"] == ["two_03"]
    assert found.about["held_out_share"] >= 0.2
    assert found.chosen(False, 42).size > 10 and found.chosen(True, 42).size > 2
    assert not found.chosen(False, 60).size and found.length.max() == 50
    assert found.joints().shape == (len(found.hips), 23, 3)
    found.save(tmp_path / "windows.npz")
    again = Windows.load(tmp_path / "windows.npz")
    assert np.array_equal(again.grounds.filtered, found.grounds.filtered) and again.about == found.about
    (tmp_path / "windows.npz").write_bytes(b"PK nothing")
    with pytest.raises(CaptureError, match="holds no windows of captures"):
        Windows.load(tmp_path / "windows.npz")


def test_what_cannot_be_cut_is_told(tmp_path):
    with pytest.raises(CaptureError, match="No clip is 35 frames long"):
        cut([walk(20)], 30)
    assert clips_of(tmp_path) == []
