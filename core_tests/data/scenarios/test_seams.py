"""Where captured pieces meet: what is softened or filled there, and what the report tells of it."""

from __future__ import annotations

import json

import captures
import numpy as np
import pytest
from gaps_of_walks import walk

from nsm_core.body.ik.between import ENDS
from nsm_core.conventions import FPS
from nsm_core.data.coverage import ABOUT, at_seams, report
from nsm_core.data.export import export
from nsm_core.data.scenarios.composer import Composer
from nsm_core.data.scenarios.seams import AROUND, FILLED, JOINS, ONE, gaps
from nsm_core.data.storage import Dataset


def pieces() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hips, rotations and feet of a walk that goes on half a step later and a little aside from frame 60."""
    clip = walk(120)
    hips, rotations = (np.concatenate((v[:60], v[68:])) for v in (clip.hips_position, clip.local_rotations))
    hips[60:] += hips[59] - hips[60] + (0.05, 0.0, 0.0)
    return hips, rotations, np.ones((len(hips), 2), bool)


def test_a_gap_lies_about_its_seam_and_leaves_kept_frames_between():
    assert gaps([50], 100) == [(50 - AROUND, 50 + AROUND)]
    one, other = gaps([60, 50], 100)  # in whatever order pieces were laid
    assert other[0] - one[1] >= ENDS and one[0] < 50 < one[1] and other[0] < 60 < other[1]
    assert gaps([50, 50, 50 + ONE - 1], 100) == [(50 - AROUND, 50 + ONE - 1 + AROUND)]


def test_there_is_no_gap_at_the_very_ends():
    assert gaps([1, 98], 100) == []
    assert gaps([90, 98], 100) == [(90 - AROUND, 90 + AROUND)]
    assert gaps([ENDS, 97], 100) == [(ENDS, ENDS + AROUND), (97 - AROUND, 98)]


def test_a_filled_seam_does_not_jump_and_keeps_what_is_not_about_it():
    hips, rotations, feet = pieces()
    was, turned, stood = hips.copy(), rotations.copy(), feet.copy()
    JOINS[FILLED]()(hips, rotations, feet, [60])
    gap = np.arange(60 - AROUND, 60 + AROUND)
    for old, new in ((was, hips), (turned, rotations), (stood, feet)):
        np.testing.assert_array_equal(np.delete(old, gap, axis=0), np.delete(new, gap, axis=0))
    assert not feet[gap].all(), "feet that swing through a gap were told to stand"
    jolt = [np.abs(np.diff(v, n=2, axis=0)).max() for v in (was, hips)]
    assert jolt[0] > 0.04 and jolt[1] < 0.02
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=-1), 1, atol=1e-5)


def hopped(jump: float) -> tuple[Dataset, list]:
    """Two takes of joints that go 1 m/s, all but one foot high over the floor; in the first the pieces meet
    at frame 30, from which one joint is ``jump`` metres on.
    """
    joints = np.zeros((120, 23, 3))
    joints[..., 2] = 1.0
    joints[:, :, 1] = np.arange(120)[:, None] / FPS
    joints[30:60, 4, 0] += jump
    contact = np.zeros((120, 5))
    start = np.repeat([0, 60], 60)
    takes = [
        {"start": 0, "pieces": [("a", 0, 30, 30), ("b", 9, 39, 30)]},
        {"start": 60, "pieces": [("a", 0, 60, 60)]},
    ]
    return Dataset({"joint_position": joints, "contact": contact, "start": start}, np.arange(0)), takes


def test_the_report_finds_what_jumps_where_pieces_meet():
    data, takes = hopped(0.01)
    found = at_seams(data, takes)
    assert found is not None and found.count == 1
    assert found.acceleration == pytest.approx(0.01 * FPS**2)  # there, and back again
    assert found.jerk == pytest.approx(2 * 0.01 * FPS**3)
    assert found.glides == found.stand == 0
    smooth = at_seams(*hopped(0.0))
    assert smooth is not None and smooth.acceleration == pytest.approx(0, abs=1e-6)
    takes[0]["pieces"] = [("a", 0, ABOUT - 1, ABOUT - 1), ("b", 0, 40, 61 - ABOUT)]
    assert at_seams(data, takes) is None


def test_the_report_tells_feet_that_glide_from_those_that_stand():
    data, takes = hopped(0.0)
    data.arrays["joint_position"][:, :, 2] = 0.02  # all feet, at 1 m/s
    data.arrays["contact"][:, 4] = 1  # one of them is told to stand
    found = at_seams(data, takes)
    assert found is not None and found.glides == 1 and found.stand == pytest.approx(100)


@pytest.mark.slow
def test_takes_are_composed_with_filled_seams(tmp_path_factory, tmp_path):
    folder = captures.capture_folder(tmp_path_factory)
    seed, softened = next(iter(captures.seeded(folder).items()))
    shares = {"sit": 0.68, "walk": 0.27, "run": 0.05}
    filled = Composer(captures.source(folder), shares, join=JOINS[FILLED]()).compose(seed)
    assert filled is not None and len(filled) == len(softened) and filled.provenance == softened.provenance
    off = np.linalg.norm(filled.hips - softened.hips, axis=1)
    assert 0.001 < off.max() < 0.3
    out = export(str(folder), tmp_path / "data", 0.2, workers=1, seams=FILLED)
    assert json.loads((out / "data.json").read_text())["seams"] == FILLED
    assert f"where they meet ({FILLED})" in report(out)
