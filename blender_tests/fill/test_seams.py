"""Seams between two motions, and animations thinned out to a pose a second and made again."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from gaps import outside, playing, walking
from test_fill_gap import filled, joints

from nsm_blender.fill.gap import pose_span
from nsm_blender.fill.key_arrays import read_keys, taken, write_keys
from nsm_blender.fill.merge import merge_strips
from nsm_blender.rigs.character import add_character
from nsm_blender.ui.reviews import pending
from nsm_core.errors import GapError

pytestmark = pytest.mark.usefixtures("addon")


@pytest.fixture
def hero():
    """A character that walks, chosen in the sidebar."""
    character = add_character((0.0, 0.0, 0.0))
    walking(character, 30)
    scene = bpy.context.scene
    scene.nsm.character, scene.nsm.fill.method = character, "interpolate"
    return character


def most_moved(character, frames) -> float:
    return float(np.linalg.norm(np.diff(joints(character, frames), axis=0), axis=-1).max())


def test_a_cut_between_two_motions_is_made_a_transition(hero):
    cut_at = 50
    for curve in playing(hero):  # half a step is left out, so that the second half begins with another foot
        keys = read_keys(curve)
        keys = taken(keys, (keys["co"][:, 0] <= cut_at) | (keys["co"][:, 0] > cut_at + 16))
        for name in ("co", "handle_left", "handle_right"):
            keys[name][keys[name][:, 0] > cut_at, 0] -= 16
        write_keys(curve, keys)
    scene = bpy.context.scene
    assert most_moved(hero, range(cut_at - 1, cut_at + 3)) > 0.25
    scene.frame_set(cut_at)
    scene.nsm.fill.where, scene.nsm.fill.seam = "SEAM", 12
    before = outside(hero, cut_at - 12, cut_at + 12)
    assert bpy.ops.nsm.fill() == {"FINISHED"}
    assert outside(hero, cut_at - 12, cut_at + 12) == before
    assert most_moved(hero, range(cut_at - 14, cut_at + 15)) < 0.2


def test_what_is_thinned_out_is_made_again_from_a_pose_a_second(hero):
    first, last = pose_span(hero)
    whole = joints(hero, range(int(first), int(last) + 1))
    old = hero.animation_data.action
    assert bpy.ops.nsm.thin_out() == {"FINISHED"}
    scene = bpy.context.scene
    assert "are left; Decompress" in scene.nsm.results[0].text
    left = {len(curve.keyframe_points) for curve in playing(hero) if "Knee" in curve.data_path}
    seconds = int((last - first) // 30) + 1
    assert left <= {2 * seconds, 2 * seconds + 1, 2 * seconds + 2}
    kept = [frame for frame in range(int(first), int(last)) if (frame - first) % 30 == 0]
    assert np.abs(joints(hero, kept) - whole[::30][: len(kept)]).max() < 1e-4
    assert bpy.ops.nsm.decompress() == {"FINISHED"}
    again = joints(hero, range(int(first), int(last) + 1))
    assert np.abs(again[::30] - whole[::30]).max() < 1e-4
    assert np.linalg.norm(again - whole, axis=-1).mean() < 0.25
    for number in range(len(scene.nsm.takes) - 1, -1, -1):
        bpy.ops.nsm.take_remove(index=number)
    assert hero.animation_data.action == old and pending(scene) is None


def test_gaps_of_one_stretch_are_filled_in_series(hero, monkeypatch):
    from nsm_blender.fill import fill as room

    asked, real = [], room.fill
    monkeypatch.setattr(room, "fill", lambda gap, network: asked.append(gap) or real(gap, network))
    for curve in playing(hero):
        keys = read_keys(curve)
        write_keys(curve, taken(keys, np.isin(keys["co"][:, 0], (1, 2, 3, 31, 61, 62))))
    done = filled(hero, start=3, end=61)
    assert done.report["frames"] == 56 and len(asked) == 2
    first, second = asked
    # What was made is the past of what follows; the pose between is passed, not stopped at.
    made = joints(hero, range(22, 32))
    assert np.abs(second.past.world()[0] - made).max() < 1e-3
    pace = np.diff(first.target.hips_position, axis=0)[0]
    whole = second.target.hips_position[0] - first.past.hips_position[-1]
    assert np.abs(pace - whole / 58).max() < 1e-4


def test_what_is_too_short_is_not_thinned_out(hero):
    for curve in playing(hero):
        keys = read_keys(curve)
        write_keys(curve, taken(keys, keys["co"][:, 0] < 20))
    with pytest.raises(RuntimeError, match="is shorter than 1 s"):
        bpy.ops.nsm.thin_out()


def test_strips_of_the_nla_are_merged_and_the_seam_between_them_is_filled(hero):
    scene, data = bpy.context.scene, hero.animation_data
    walk, slot = data.action, data.action_slot
    track = data.nla_tracks.new()
    for start, first, last in ((1, 1, 41), (42, 58, 98)):  # half a step is left out between them
        strip = track.strips.new("Walk", start, walk)
        strip.action_slot = slot
        strip.action_frame_start, strip.action_frame_end = first, last
    data.action = None
    frames = range(1, 80)
    before = joints(hero, frames)
    assert bpy.ops.nsm.fill.poll() is False
    assert bpy.ops.nsm.merge_strips() == {"FINISHED"}
    assert "fill the Seam at the Playhead" in scene.nsm.results[0].text
    assert np.abs(joints(hero, frames) - before).max() < 1e-5
    scene.frame_set(41)
    scene.nsm.fill.where, scene.nsm.fill.seam = "SEAM", 12
    assert bpy.ops.nsm.fill() == {"FINISHED"}
    after = joints(hero, frames)
    assert np.abs(after[:29] - before[:29]).max() < 1e-5 and np.abs(after[52:] - before[52:]).max() < 1e-5
    assert most_moved(hero, range(38, 46)) < 0.2 < np.linalg.norm(before[41] - before[40], axis=-1).max()
    for number in range(len(scene.nsm.takes) - 1, -1, -1):
        bpy.ops.nsm.take_remove(index=number)
    assert data.action is None and np.abs(joints(hero, frames) - before).max() < 1e-5


def test_where_no_strips_play_nothing_is_merged(hero):
    assert bpy.ops.nsm.merge_strips.poll() is False
    with pytest.raises(GapError, match="there is nothing to merge"):
        merge_strips(hero, bpy.context.scene)
