"""What cannot be filled is told in one sentence, and the file is as it was."""

from __future__ import annotations

import bpy
import pytest
from everything import difference, digest
from foreign_rigs import remove_bones
from gaps import END, START, cut, playing

from nsm_blender.fill import fill as fill_room
from nsm_blender.fill.fill import fill_gap
from nsm_blender.fill.spec import INTERPOLATE, FillSpec
from nsm_blender.takes import finish
from nsm_core.errors import GapError, NsmError, SkeletonError, WeightsError

pytestmark = pytest.mark.usefixtures("addon")


def refused(character, error: type[NsmError], words: str, **more) -> str:
    """The sentence with which a fill is refused; nothing has changed."""
    more.setdefault("method", INTERPOLATE)
    before = digest()
    with pytest.raises(error, match=words) as raised:
        finish(fill_gap(FillSpec(character, **more), bpy.context.scene))
    told = str(raised.value)
    assert told.endswith(".") and "\n" not in told
    assert not difference(before, digest())
    return told


def curve_of(character, name: str) -> bpy.types.FCurve:
    return next(c for c in playing(character) if f'"{name}"' in c.data_path)


def test_a_gap_needs_keys_on_both_sides(hero):
    last = max(c.range()[1] for c in playing(hero))
    refused(hero, GapError, "no keys after the gap", at=last + 5)
    refused(hero, GapError, "no keys after the gap", start=last - 3, end=last + 20)
    refused(hero, GapError, "no keys before frame -3", at=-3)
    refused(hero, GapError, "no key at or before frame -8", start=-8, end=20)
    with pytest.raises(GapError, match="two ends"):
        FillSpec(hero, start=3)
    with pytest.raises(GapError, match="no method"):
        FillSpec(hero, method="magic")


def test_a_gap_has_a_length(hero):
    refused(hero, GapError, "No frame is missing between 10 and 11", at=10)
    refused(hero, GapError, "not after frame 66", start=END, end=START)
    refused(hero, GapError, "No frame is missing .* Replace Keys", start=10, end=30)
    cut(hero, 3, 98)
    refused(
        hero, GapError, "94 frames are missing between 3 and 98, and up to 90 can be filled at 30 a second"
    )
    bpy.context.scene.render.fps = 60
    done = finish(fill_gap(FillSpec(hero, method=INTERPOLATE), bpy.context.scene))
    assert done.report["frames"] == 94


def test_who_has_no_keys_or_no_bones_is_told_so(hero):
    data = hero.animation_data
    data.action = None
    refused(hero, GapError, "Character has no action")
    remove_bones(hero, "LeftKnee", "LeftAnkle", "LeftToe")
    refused(hero, SkeletonError, "No bone of Character was found for")


def test_channels_that_would_not_show_their_keys_are_named(hero):
    knee = curve_of(hero, "LeftKnee")
    knee.mute = True
    assert "LeftKnee" in refused(hero, GapError, "muted")
    knee.mute, knee.lock = False, True
    assert "LeftKnee" in refused(hero, GapError, "locked")
    knee.lock = False
    knee.group.mute = True
    refused(hero, GapError, "muted")
    knee.group.mute = False
    knee.modifiers.new("NOISE")
    refused(hero, GapError, r"modifier \(Noise\)")


def test_the_nla_in_tweak_mode_is_left_first(hero):
    data = hero.animation_data
    action, slot = data.action, data.action_slot
    track = data.nla_tracks.new()
    track.strips.new("walk", 1, action)
    data.action = None
    refused(hero, GapError, "press Merge Strips where the NLA plays it")
    data.use_tweak_mode = True
    told = refused(hero, NsmError, "tweak mode")
    assert "fill again" in told
    data.use_tweak_mode = False
    data.action, data.action_slot = action, slot


def test_weights_cut_short_are_told(hero, tmp_path, monkeypatch):
    short = tmp_path / "fill.npz"
    short.write_bytes(b"PK\x03\x04 cut short")
    real = fill_room.load_transitions
    monkeypatch.setattr(fill_room, "load_transitions", lambda: real(short))
    fill_room._network.cache_clear()
    refused(hero, WeightsError, "fill.npz", method="network")
    fill_room._network.cache_clear()


def test_a_target_far_away_is_filled_with_a_warning_that_names_the_speed(hero):
    cut(hero, 20, 31)
    ahead = next(c for c in playing(hero) if c.data_path == hero.pose.bones["Hips"].path_from_id("location"))
    for key in ahead.keyframe_points:
        key.co.y += 5.0 * (key.co.x > 30)
    done = finish(fill_gap(FillSpec(hero, at=25, method=INTERPOLATE), bpy.context.scene))
    assert done.report["frames"] == 10
    assert any("m/s" in note for note in done.report["notes"])


STAGES = ("Reading the poses", "Reading the ground", "Filling", "Keying", "Making keys", "Checking")


@pytest.mark.parametrize("stage", STAGES)
def test_a_fill_that_is_broken_off_leaves_nothing(hero, stage):
    before = digest()
    steps = fill_gap(FillSpec(hero, method=INTERPOLATE), bpy.context.scene)
    while next(steps).stage != stage:
        pass
    steps.close()
    assert not difference(before, digest())
