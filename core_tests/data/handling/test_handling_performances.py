"""Performances of picking and placing: reaches are found in captures, led elsewhere, kept and counted."""

from __future__ import annotations

import captures
import numpy as np
import pytest
from handled import handled

from nsm_core.body.contacts import ANKLES
from nsm_core.body.ik.two_bone import place_wrists
from nsm_core.body.skeleton import ARMS, INDEX, forward_kinematics
from nsm_core.data.captures import bvh_writer
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.handling.library import HandlingLibrary, handling_coverage, make_handling
from nsm_core.data.handling.performances import perform
from nsm_core.data.handling.pieces import gathered
from nsm_core.data.handling.reaching import ReachMove, fit_reach
from nsm_core.errors import CaptureError
from nsm_core.model.handling.tasks import APPROACHES, FREE, HOLDS, LEAVES

WRIST = INDEX["RightWrist"]


def reach() -> tuple[np.ndarray, np.ndarray]:
    """A stand in which the right hand goes to a place before the chest and back."""
    hips, local = captures.stand(140)
    wrist = forward_kinematics(hips, local)[0][:, WRIST]
    t = np.arange(140)
    share = (captures._ease((t - 20) / 40) - captures._ease((t - 80) / 40))[:, None]
    there = np.append(hips[0, :2], 1.25) + np.array((-0.2, -0.45, 0.0))
    return hips, place_wrists(hips, local, 0, wrist + share * (there - wrist))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = captures.write_captures(tmp_path_factory.mktemp("handling") / "captures")
    bvh_writer.write_bvh(made / "me_reach_forward.bvh", *reach())
    return made


def test_a_reach_goes_where_it_is_led_and_the_feet_stay():
    hips, local = reach()
    before = forward_kinematics(hips, local)[0]
    roots, headings = hips[:, :2], np.zeros(len(hips))
    goal = np.array((-0.35, -0.4, 0.7))
    move = ReachMove(0, 20, 62, 78, 120, goal)
    after = forward_kinematics(*fit_reach(hips, local, roots, headings, move))[0]
    wished = goal + np.append(roots[62], 0)
    assert np.linalg.norm(after[62:79, WRIST] - wished, axis=-1).max() < 0.01
    assert np.linalg.norm(before[62, WRIST] - wished) > 0.5
    assert np.abs(after[:, ANKLES] - before[:, ANKLES]).max() < 0.01
    assert np.array_equal(after[:8], before[:8]) and np.array_equal(after[132:], before[132:])
    # One motion: no frame jumps.
    assert np.linalg.norm(np.diff(after[:, WRIST], n=2, axis=0), axis=-1).max() < 0.02


def test_performances_walk_up_and_reach(folder):
    source = gathered(CaptureFolder(folder))
    assert len(source.segments["reach"]) == 2  # and its mirror image
    made = [p for p in (perform(source, seed) for seed in range(4)) if p is not None]
    assert made
    for p in made:
        assert {FREE, APPROACHES, HOLDS, LEAVES} == set(p.tasks.ravel())
        positions = forward_kinematics(p.hips, p.rotations)[0]
        for side in (0, 1):
            held = p.tasks[:, side] == HOLDS
            changes = np.flatnonzero(np.diff(p.tasks[:, side]) != 0) + 1
            assert p.keys[changes].all()
            if held.any():
                wrist = positions[held, ARMS[side][2]]
                assert 0.15 < wrist[:, 2].min() and wrist[:, 2].max() < 2.05
    again = perform(source, 0)
    first = perform(source, 0)
    assert (again is None) == (first is None)
    assert first is None or np.array_equal(first.rotations, again.rotations)


def test_captures_without_a_reach_are_refused_in_a_sentence(tmp_path):
    made = captures.write_captures(tmp_path / "captures")
    with pytest.raises(CaptureError, match="holds no reach"):
        gathered(CaptureFolder(made))


def test_a_library_is_kept_and_gone_on_with(folder, tmp_path):
    first = make_handling(tmp_path, folder, 200, lambda _: None)
    written = {p: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    again = make_handling(tmp_path, "nowhere", 200, lambda _: None)
    assert {p: p.stat().st_mtime_ns for p in tmp_path.iterdir()} == written
    assert again.frames == first.frames >= 200
    assert np.array_equal(again.performances[0].keys, first.performances[0].keys)
    next(tmp_path.iterdir()).write_bytes(b"nothing")
    with pytest.raises(CaptureError, match="delete it"):
        make_handling(tmp_path, folder, 200, lambda _: None)


def test_coverage_counts_seconds_and_reaches():
    told = handling_coverage(HandlingLibrary((handled(), handled())))
    assert "2 performances, 0.2 minutes" in told
    row = next(line for line in told.splitlines() if line.startswith("right") and "holds" in line)
    assert row.split()[2:] == ["1.0", "10.0"]
