"""Takes without stitching: captured pieces on their own, with their commands, seats and labels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import captures
import numpy as np
import pytest

from nsm_core.body.skeleton import ARMS, HIP_OVER_SEAT, HIPS
from nsm_core.conventions import SIT
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.data.scenarios.take import ComposedTake, annotate
from nsm_core.evaluation.measures.motion import jumps


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return captures.capture_folder(tmp_path_factory)


def composed(folder: Path, shares: dict[str, float] | None, count: int, source=None) -> list[ComposedTake]:
    composer = Composer(source or captures.source(folder), shares, stitch=False)
    return [take for take in map(composer.compose, range(count)) if take is not None]


def test_every_take_is_one_captured_piece(folder):
    takes = composed(folder, None, 14)
    assert len(takes) > 6
    for take in takes:
        assert len({piece[0] for piece in take.provenance}) == 1, "it is stitched of several clips"
        speed = np.linalg.norm(np.diff(annotate(take).joint_position, axis=0), axis=-1) * 30
        assert speed.max() < 6 and take.commands[0].frame == 0
        assert not any(c.action in ("open", "idle+climb") for c in take.commands)
    assert {c.action for take in takes for c in take.commands} >= {"walk", "idle", "sit"}


def test_level_clips_are_played_as_captured_and_led_along(folder):
    lib = captures.source(folder).library
    walked = composed(folder, {"walk": 1}, 12)
    assert len(walked) == 12
    for take in walked:
        clip, first, last = take.provenance[0][:3]
        assert (first, last) == (0, len(take)) and len(take.provenance) == 1, (
            "a short clip is not played whole"
        )
        start = int(np.flatnonzero(lib.clip_of == lib.names.index(clip))[0])
        own = np.linalg.norm(np.diff(lib.root[start : start + len(take)], axis=0), axis=1).sum()
        root = annotate(take).root[:, :2]
        assert np.linalg.norm(np.diff(root, axis=0), axis=1).sum() == pytest.approx(own, rel=0.05, abs=0.02)
        for c in (c for c in take.commands if c.action == "idle"):
            assert np.linalg.norm(root - c.position[:2], axis=1).min() < 0.03, (
                "one is asked to stand where nobody stands"
            )
    assert any(c.position is None for take in walked for c in take.commands)
    assert any(c.action == "idle" for take in walked for c in take.commands)


def test_a_long_clip_gives_a_stretch_of_at_least_four_seconds(folder, monkeypatch):
    monkeypatch.setattr("nsm_core.data.scenarios.single_clips.LONGEST", 130)
    long = [take for take in composed(folder, {"walk": 1}, 12) if take.provenance[0][1] > 0]
    assert long and all(120 <= len(take) < 130 for take in long)


def test_the_seat_stands_under_the_captured_sit(folder):
    sat = composed(folder, {"sit": 1}, 12)
    assert len(sat) > 5
    for take in sat:
        thing, seated = take.things[0], take.labels[:, SIT] == 1
        assert [(c.action, c.thing) for c in take.commands] == [
            ("sit", 0),
            ("idle", -1),
        ] and seated.sum() > 20
        hips = annotate(take).joint_position[seated, HIPS]
        assert np.median(hips[:, 2]) == pytest.approx(thing.furniture.seat.height + HIP_OVER_SEAT, abs=0.04)
        assert np.linalg.norm(take.commands[0].position - hips.mean(0)) < 0.1
        assert np.linalg.norm(thing.position - hips.mean(0)[:2]) < 0.5
        assert take.commands[1].frame > np.flatnonzero(seated)[0], "one is asked to rise before one sits"
        assert take.labels[0, SIT] == 0 and take.labels[-1, SIT] == 0


def test_one_captured_bend_takes_a_box_lifts_it_and_puts_it_back(tmp_path):
    folder = captures.write_captures(tmp_path)
    captures.write_pick_up(folder)
    takes = composed(folder, {"carry": 1}, 12, load(str(folder)))
    assert len(takes) > 3
    for take in takes:
        thing = take.things[0]
        assert [c.action for c in take.commands] == ["carry", "walk+carry", "idle+carry", "idle"]
        assert [c.thing for c in take.commands] == [0, 0, 0, -1] and len(
            {piece[0] for piece in take.provenance}
        ) == 1
        np.testing.assert_allclose(thing.poses[0, :3], thing.poses[-1, :3], atol=1e-6)
        assert abs(thing.poses[0, 3] - thing.poses[-1, 3]) < 0.15
        height = thing.poses[:, 2] - thing.poses[0, 2]
        assert height.max() > 0.2 or thing.poses[0, 2] > 0.6, "it is not lifted"
        assert (height[~thing.held] < 1e-6).all() and thing.held.sum() > 45
        wrists = annotate(take).joint_position[:, [arm[2] for arm in ARMS]]
        apart = np.linalg.norm(wrists[:, 0] - wrists[:, 1], axis=-1)[thing.held]
        assert np.ptp(apart) < 0.02, "the hands slip on the box"
        assert jumps(take.hips, take.rotations)["jolt_cm"] < 8


def test_what_the_captures_lack_is_left_out(folder):
    source = captures.source(folder)
    assert composed(folder, {"open": 1, "climb": 1}, 5) == []
    assert composed(folder, {"sit": 1}, 5, replace(source, segments={})) == []
    assert composed(folder, {"run": 1}, 3) == [], "nobody runs in these captures"
    assert len(composed(folder, {"walk": 0.1, "open": 0.9}, 3)) == 3
