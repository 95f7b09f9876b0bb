"""What a person writes into the sections of a sidecar is what takes are composed of: the phase of frames, and
a seat's place.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import captures
import numpy as np
import pytest

from nsm_core.__main__ import main
from nsm_core.commands.annotate import with_phase
from nsm_core.conventions import SIT
from nsm_core.data.captures import bvh_writer, sidecar, sidecar_writer
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.data.scenarios.take import ComposedTake, annotate, phase_of
from nsm_core.errors import CaptureError
from nsm_core.rotations import rotate_planar, wrap_angle


@pytest.fixture(scope="module")
def studio(tmp_path_factory) -> Path:
    """A walk, a quiet stand and a sit-down, annotated."""
    folder = tmp_path_factory.mktemp("edited")
    for name, motion in {
        "walk": captures.walk(4.2, 0.5, 4.3),
        "stand": captures.stand(),
        "sit": captures.sit(),
    }.items():
        bvh_writer.write_bvh(folder / f"{name}.bvh", *motion)
    assert main(["annotate", str(folder), "--no-pictures"]) == 0
    return folder


def edited(studio: Path, tmp_path: Path, name: str, change) -> Path:
    """A copy of the folder in which one clip's sidecar went through ``change``."""
    folder = tmp_path / "studio"
    shutil.copytree(studio, folder)
    path = sidecar.sidecar_of(folder / f"{name}.bvh")
    sidecar_writer.write_sheet(path, change(sidecar.read_sheet(path)))
    return folder


def of_clip(folder: Path, name: str) -> ComposedTake:
    """The first take that plays a clip, not its mirror image, on its own."""
    composer = Composer(load(str(folder)), {"walk": 1}, stitch=False)
    takes = (composer.compose(seed) for seed in range(20))
    return next(
        t
        for t in takes
        if t is not None and t.provenance[0].clip.split("@")[0] == name and "~" not in t.provenance[0].clip
    )


def test_an_edited_phase_is_the_phase_of_its_frames(studio, tmp_path):
    keys = [(0, 1.0), (60, 0.25), (100, 1.0), (120, 0.5), (150, 1.0)]
    changed = edited(studio, tmp_path, "walk", lambda s: s.with_section("phase", keys))
    before, after = of_clip(studio, "walk"), of_clip(changed, "walk")
    assert before.phase is None and after.provenance == before.provenance
    np.testing.assert_array_equal(after.hips, before.hips)
    first = after.provenance[0].first
    phase, rule = annotate(after).phase, annotate(before).phase
    for frame, value in keys[1:-1]:
        assert abs((phase[frame - first] - value + 0.5) % 1 - 0.5) < 0.01
    speed = np.diff(phase)
    np.testing.assert_allclose(speed[62 - first : 98 - first], 0.75 / 40, atol=1e-3)
    assert speed.min() >= 0 and np.abs((phase - rule + 0.5) % 1 - 0.5).max() > 0.2


def test_edited_feet_stand_where_they_are_said_to(studio, tmp_path):
    changed = edited(
        studio,
        tmp_path,
        "walk",
        lambda s: s.with_section("contacts.LeftAnkle", [(0, 1.0), (60, 0.0), (75, 1.0)]),
    )
    one, other = (load(str(f)).library for f in (studio, changed))
    for clip, left in (("walk", 1), ("walk~", 0)):  # of the mirror image it is the right one
        named = [
            k
            for k, name in enumerate(other.names)
            if name.split("@")[0] == clip[:4] and name.endswith("~") == (clip != "walk")
        ]
        rows = np.isin(other.clip_of, named)
        first = int(other.names[named[0]].rstrip("~").split("@")[1])
        frames = np.arange(rows.sum()) + first
        np.testing.assert_array_equal(other.contacts[rows][:, left] > 0.5, (frames < 60) | (frames >= 75))
        np.testing.assert_array_equal(other.contacts[rows][:, 1 - left], one.contacts[rows][:, 1 - left])


def test_the_phase_of_the_mirror_image_is_its_own_section(studio, tmp_path):
    changed = edited(
        studio, tmp_path, "walk", lambda s: s.with_section("phase_mirrored", [(0, 1.0), (150, 0.5)])
    )
    lib = load(str(changed)).library
    told = {lib.names[k] for k in np.unique(lib.clip_of[np.isfinite(lib.phase)])}
    assert told and all(name.endswith("~") and name.startswith("walk") for name in told)


def test_a_measured_phase_counts_and_a_proposal_leaves_the_rule_in_force(studio, tmp_path):
    assert np.isnan(load(str(studio)).library.phase).all()
    measured = [(0, 1.0), (90, 0.5)]

    def change(sheet):
        return with_phase(sheet, {"phase": measured}, [])

    folder = edited(studio, tmp_path, "walk", change)
    assert sidecar.read_sheet(folder / "walk.nsm.toml").edited() == []
    assert np.isfinite(load(str(folder)).library.phase).any()


def test_the_rule_leads_from_one_told_stretch_to_the_next():
    told = np.full(120, np.nan)
    told[20:40], told[60:90] = 0.3 + np.arange(20) / 40, 0.9 + np.arange(30) / 25
    contacts = np.zeros((120, 2))
    contacts[45:50, 1] = contacts[70:75, 1] = contacts[105:110, 1] = 1
    phase = phase_of(contacts, np.ones(120), [], 120, told)
    known = np.isfinite(told)
    np.testing.assert_allclose((phase[known] - told[known] + 0.5) % 1, 0.5, atol=1e-5)
    assert (np.diff(phase) > 0).all() and abs(
        (phase[105] + 0.5) % 1 - 0.5
    ) < 1e-5  # a landing that no one has told about


def moved(
    sheet: sidecar.Sheet, by: tuple[float, float, float], turned: float = 0.0, sooner: int = 0
) -> sidecar.Sheet:
    """The sheet with the goals of its sit changed: the place, metres, the facing, degrees, and when rising is
    asked for, frames.
    """
    sit, rise = sheet.goals
    place = tuple(float(a + b) for a, b in zip(sit.place, by, strict=True))
    return sheet.with_section(
        "goals",
        [replace(sit, place=place, facing=sit.facing + turned), replace(rise, frame=rise.frame - sooner)],
    )


def test_an_edited_goal_moves_the_seat_and_when_rising_is_asked_for(studio, tmp_path):
    changed = edited(studio, tmp_path, "sit", lambda s: moved(s, (0.03, 0.06, -0.04), 10.0, 20))
    one, other = (Composer(load(str(f)), {"sit": 1}, stitch=False) for f in (studio, changed))
    pairs = ((one.compose(seed), other.compose(seed)) for seed in range(20))
    before, after = next(
        (a, b) for a, b in pairs if a is not None and b is not None and a.things and b.things
    )
    asked, (hips, heading) = [], ([], [])
    for take in (before, after):
        k = next(k for k, c in enumerate(take.commands) if c.action == "sit")
        asked.append((take.commands[k], take.commands[k + 1]))
        rest = np.flatnonzero(take.labels[:, SIT] == 1)
        middle = rest[len(rest) // 2]
        hips.append(take.hips[middle])
        heading.append(annotate(take).root[middle, 2])
    gaps = []
    for (sit, _), where, facing in zip(asked, hips, heading, strict=True):
        off = sit.position - where
        gaps.append(
            (
                *rotate_planar(off[:2], np.float64(-facing)),
                off[2],
                np.degrees(wrap_angle(sit.heading - facing)),
            )
        )
    side = next(-1 if "~" in p.clip else 1 for p in after.provenance if p.clip.startswith("sit"))
    change = np.subtract(gaps[1], gaps[0])
    np.testing.assert_allclose(change[:3], (0.03 * side, 0.06, -0.04), atol=0.012)
    assert change[3] == pytest.approx(10.0 * side, abs=1.0)
    seats = [t.things[0] for t in (before, after)]
    assert seats[0].furniture.seat.height == pytest.approx(seats[1].furniture.seat.height)
    leaves = [np.flatnonzero(t.labels[:, SIT] == 1)[-1] for t in (before, after)]
    assert leaves[1] - asked[1][1].frame in (19, 20, 21) and leaves[0] - asked[0][1].frame > 25


def test_a_goal_far_from_the_hips_is_told(studio, tmp_path):
    changed = edited(studio, tmp_path, "sit", lambda s: moved(s, (0.0, 2.0, 0.0)))
    with pytest.raises(
        CaptureError,
        match=r"^sit\.nsm\.toml: the sit goal of frame \d+ lies 2\.0 m from the hips .*0\.3 m of them\.$",
    ):
        load(str(changed))


def test_only_goals_that_are_read_are_written(studio):
    assert [g.action for g in sidecar.read_sheet(studio / "sit.nsm.toml").goals] == ["sit", "idle"]
    assert "[[goals]]" not in (studio / "walk.nsm.toml").read_text()
