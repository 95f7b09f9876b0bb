"""Keys that the animator has set in a take are in the next try of it, as they were, and led to by the new
motion.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from motions import blender_heads, wandering_take

from nsm_blender.animation.channels import channels_of
from nsm_blender.keys.edits import edited_keys
from nsm_blender.keys.keyed import KeyedTake
from nsm_blender.keys.keying import key_take
from nsm_blender.keys.style import KeyStyle
from nsm_blender.rigs.armature import build_armature
from nsm_core.body.key_reduction import Bound
from nsm_core.rotations import quat_conjugate, quat_mul, quat_normalize

HEAD = 'pose.bones["Head"].rotation_quaternion'
PLAIN = KeyStyle()


@pytest.fixture
def armature():
    bpy.context.scene.render.fps = 30
    return build_armature("Character")


def take(armature: bpy.types.Object, seed: int, style: KeyStyle = PLAIN, start: int = 1) -> KeyedTake:
    hips, local = wandering_take(60, seed)
    local[:, 6] = (1, 0, 0, 0)  # the head follows
    return key_take(armature, hips, local, frame_start=start, name="Take", style=style)


def curve(armature: bpy.types.Object, path: str, index: int = 0) -> bpy.types.FCurve:
    return next(c for c in channels_of(armature).bag.fcurves if (c.data_path, c.array_index) == (path, index))


def turns(armature: bpy.types.Object, frames: range) -> np.ndarray:
    """Rotations (N, 4) of the head's channels."""
    each = [curve(armature, HEAD, i) for i in range(4)]
    return quat_normalize(np.array([[c.evaluate(f) for c in each] for f in frames]))


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(2 * np.arctan2(*(lambda d: (np.linalg.norm(d[..., 1:], axis=-1), abs(d[..., 0])))(
        quat_mul(a, quat_conjugate(b)))))  # fmt: skip


def nod(armature: bpy.types.Object, frame: int, by: float = 0.6) -> None:
    """Key a nod of the head by hand."""
    bone = armature.pose.bones["Head"]
    bone.rotation_quaternion = (np.cos(by / 2), np.sin(by / 2), 0, 0)
    bone.keyframe_insert("rotation_quaternion", frame=frame)


def test_a_take_as_it_was_made_has_no_edits(armature):
    for style in (PLAIN, KeyStyle(reduce=Bound())):
        made = take(armature, 1, style)
        assert not list(edited_keys(made.action, made.slot))
        again = take(armature, 2, style)
        assert again.kept.sentence() == "" and not again.kept.counts


def test_a_key_set_over_a_generated_one_is_kept_and_led_to(armature):
    take(armature, 1)
    nod(armature, 30)
    again = take(armature, 2)
    assert again.kept.sentence().startswith("Your key on Head at frame 30 was kept")
    off = angle(turns(armature, range(1, 61)), np.array((1.0, 0, 0, 0)))
    assert off[29] == pytest.approx(np.degrees(0.6), abs=0.01)
    assert (np.diff(off[17:30]) >= -1e-4).all() and (np.diff(off[29:42]) <= 1e-4).all()
    assert off[:17].max() < 1e-3 and off[42:].max() < 1e-3 and np.abs(np.diff(off)).max() < 5
    third = take(armature, 3)  # and once more
    assert "Your key on Head at frame 30" in third.kept.sentence()


def test_between_his_keys_nothing_but_his_motion_plays(armature):
    first = take(armature, 1)
    head = [c for c in channels_of(armature).bag.fcurves if c.data_path == HEAD]
    for c in head:
        for key in [k for k in c.keyframe_points if 20 <= k.co[0] <= 40][::-1]:
            c.keyframe_points.remove(key)
    for frame, by in ((22, 0.0), (30, 0.7), (38, 0.0)):
        nod(armature, frame, by)
    before = turns(armature, range(22, 39))
    again = take(armature, 2)
    assert again.action != first.action and again.kept.counts == {"Head": 3}
    frames = [k.co[0] for k in curve(armature, HEAD).keyframe_points if 19 < k.co[0] < 41]
    assert frames == [20, 21, 22, 30, 38, 39, 40]
    assert angle(turns(armature, range(22, 39)), before).max() < 0.01


def test_what_a_take_has_no_keys_of_comes_along_whole(armature):
    armature["smile"] = 0.0
    take(armature, 1)
    for frame, value in ((5, 0.0), (20, 1.0)):
        armature["smile"] = value
        armature.keyframe_insert('["smile"]', frame=frame)
    armature.pose.bones["Head"].scale = (1, 1.2, 1)
    armature.pose.bones["Head"].keyframe_insert("scale", frame=12)
    take(armature, 2)
    assert [tuple(k.co) for k in curve(armature, '["smile"]').keyframe_points] == [(5, 0), (20, 1)]
    assert curve(armature, 'pose.bones["Head"].scale', 1).evaluate(12) == pytest.approx(1.2)


@pytest.mark.parametrize("style", [PLAIN, KeyStyle(reduce=Bound())])
def test_other_bones_and_far_frames_move_as_without_edits(armature, style):
    take(armature, 1, style)
    alone = build_armature("Alone")
    take(alone, 2, style)
    nod(armature, 30)
    take(armature, 2, style)
    for bone in ("Hips", "LeftKnee"):
        for path in (f'pose.bones["{bone}"].rotation_quaternion',):
            ours, others = curve(armature, path, 2), curve(alone, path, 2)
            assert all(ours.evaluate(f) == pytest.approx(others.evaluate(f), abs=1e-5) for f in range(1, 61))
    gap = angle(turns(armature, range(1, 61)), turns(alone, range(1, 61)))
    assert max(gap[:14].max(), gap[45:].max()) < (0.01 if style is PLAIN else 1.5)
    assert np.abs(blender_heads(armature, range(1, 5)) - blender_heads(alone, range(1, 5))).max() < 1e-3


def test_a_take_that_begins_elsewhere_or_is_to_be_fresh_has_none_of_them(armature):
    take(armature, 1)
    nod(armature, 30)
    fresh = take(armature, 2, KeyStyle(keep_edits=False))
    assert not fresh.kept.counts and angle(turns(armature, range(30, 31)), np.array((1.0, 0, 0, 0)))[0] < 1e-3
    nod(armature, 30)
    assert not take(armature, 3, start=5).kept.counts
