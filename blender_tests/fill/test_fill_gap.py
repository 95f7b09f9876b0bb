"""Missing frames are made, and nothing else changes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from foreign_rigs import MIXAMO, foreign_rig
from gaps import cut, inside, outside, playing, walk, walking
from scenes import box

from nsm_blender.animation.channels import GENERATED
from nsm_blender.fill.fill import FilledGap, fill_gap
from nsm_blender.fill.key_arrays import read_keys
from nsm_blender.fill.spec import INTERPOLATE, FillSpec
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import read_back
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import finish
from nsm_core.body.skeleton import INDEX, forward_kinematics


def filled(character, **more) -> FilledGap:
    more.setdefault("method", INTERPOLATE)
    return finish(fill_gap(FillSpec(character, **more), bpy.context.scene))


def joints(character, frames) -> np.ndarray:
    hips, local = read_back(character, frames)
    return forward_kinematics(hips, local)[0]


@pytest.fixture(scope="module", autouse=True)
def motion():
    """The walk, made before the first test opens its scene."""
    return walk()


RIGS = {
    "bundled at 24": (lambda: add_character((0.0, 0.0, 0.0)), 24),
    "bundled at 60": (lambda: add_character((1.0, 2.0, 0.0)), 60),
    "mixamo in centimetres": (lambda: foreign_rig(MIXAMO, unit=0.01), 30),
}


@pytest.mark.parametrize("rig", RIGS)
def test_keys_outside_a_gap_stay_byte_for_byte_and_frames_inside_are_keyed(rig):
    make, fps = RIGS[rig]
    character = make()
    old = walking(character, fps)
    start, end = (round(1 + seconds * fps) for seconds in (1.4, 2.2))
    cut(character, start, end)
    before, shown = outside(character, start, end), joints(character, range(start - 3, end + 4))
    bpy.context.scene.frame_set((start + end) // 2)
    done = filled(character)
    assert (done.report["from"], done.report["to"]) == (start, end)
    assert done.report["frames"] == end - start - 1 and done.keyed.previous_action == old
    after = outside(character, start, end)
    assert before == {path: after[path] for path in before}
    for curve in playing(character):
        keys = read_keys(curve)
        made = inside(keys, start, end)
        if (curve.data_path, curve.array_index) in before and len(keys["co"]) > 2:
            assert keys["co"][made, 0].tolist() == list(range(start + 1, end))
            assert (keys["type"][made] == GENERATED).all()
    now = joints(character, range(start - 3, end + 4))
    assert np.abs(now[:4] - shown[:4]).max() < 1e-5 and np.abs(now[-4:] - shown[-4:]).max() < 1e-5
    # Nothing jumps: no frame moves a joint further than the walk itself does, but for a swinging foot.
    steps = np.linalg.norm(np.diff(now, axis=0), axis=-1).max(-1) * fps
    assert steps.max() < 5.0 and done.report["shown_off_cm"] < 0.1
    discard_take(done.keyed)
    assert character.animation_data.action == old and before == outside(character, start, end)


def test_others_are_not_walked_over_and_steps_are():
    character = add_character((0.0, 0.0, 0.0))
    walking(character, 30)
    cut(character, 40, 66)
    bpy.context.scene.frame_set(50)
    box("Floor", (-9, -9, -0.1), (9, 9, 0))
    hips = character.matrix_world @ character.pose.bones["Hips"].head
    other = add_character((hips.x, hips.y, 0.0))
    assert filled(character).report["penetration_cm"] < 3
    bpy.data.objects.remove(other)
    box("Step", (-9, -9, 0), (9, 9, 0.3))  # up to the shins of who walks there
    low = joints(character, [50])[0, :, 2].min()
    filled(character)
    assert joints(character, [50])[0, :, 2].min() > low + 0.1  # feet are set on it


def test_a_body_is_kept_out_of_what_stands_beside_its_way():
    character = add_character((0.0, 0.0, 0.0))
    walking(character, 30)
    wrist = character.pose.bones["LeftWrist"]
    cut(character, 40, 66)
    bpy.context.scene.frame_set(53)
    through = np.array(character.matrix_world @ wrist.head)
    box("Floor", (-9, -9, -0.1), (9, 9, 0))
    depths = []
    for solid in (False, True):
        post = box("Post", (*(through[:2] - 0.04), 0.0), (*(through[:2] + 0.04), 1.4))
        post["nsm_collider"] = solid
        filled(character, start=40, end=66)
        low, high = through[:2] - 0.04, through[:2] + 0.04
        hands = joints(character, range(41, 66))[:, [INDEX["LeftWrist"], INDEX["LeftElbow"]], :2]
        depths.append(int(((hands > low) & (hands < high)).all(-1).sum()))
        bpy.data.objects.remove(post)
    assert depths[0] > 0 and depths[1] == 0
