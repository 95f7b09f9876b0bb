"""Poses keyed by hand, as animators block a scene: few keys, Bezier or stepped, euler angles, single keys."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from gaps import outside, playing, walk
from test_fill_gap import filled, joints

from nsm_blender.fill.key_arrays import read_keys, taken, write_keys
from nsm_blender.keys.preview import Preview
from nsm_blender.rigs.character import add_character
from nsm_core.errors import GapError

POSES = {1: 30, 31: 60, 61: 75}  # scene frames and frames of the walk


@pytest.fixture(scope="module", autouse=True)
def motion():
    """The walk, made before a test opens its scene."""
    return walk()


def keyed_by_hand(character, frame: int, row: int, but: tuple[str, ...] = ()) -> None:
    """Key a pose of the walk on all bones but some."""
    hips, local = walk()
    Preview(character).show(hips[row], local[row])
    for bone in character.pose.bones:
        if bone.name not in but:
            channel = "rotation_quaternion" if bone.rotation_mode == "QUATERNION" else "rotation_euler"
            bone.keyframe_insert(channel, frame=frame)
    character.pose.bones["Hips"].keyframe_insert("location", frame=frame)


@pytest.fixture
def blocked():
    """Three poses, some bones in euler angles, one that is keyed at the first and the last alone."""
    character = add_character((0.0, 0.0, 0.0))
    for name, mode in (("LeftKnee", "XYZ"), ("RightHip", "ZYX"), ("Chest", "YXZ"), ("Head", "AXIS_ANGLE")):
        character.pose.bones[name].rotation_mode = mode
    for frame, row in POSES.items():
        keyed_by_hand(character, frame, row, ("LeftWrist", "Head", *(("RightWrist",) if frame == 31 else ())))
    bpy.context.scene.frame_set(10)
    return character


def seen(character, frames) -> np.ndarray:
    return joints(character, frames)


def test_poses_by_hand_are_filled_and_what_is_outside_looks_the_same(blocked):
    shown = seen(blocked, [*range(-5, 2), *range(31, 70)])
    before = outside(blocked, 1, 31)
    done = filled(blocked)
    assert (done.report["from"], done.report["to"]) == (1, 31)
    after = outside(blocked, 1, 31)
    changed = {path for path in before if before[path] != after[path]}
    # The wrist without a key at 31 gets one there and keeps its way to the next one; nobody else is touched.
    assert {path for path, _ in changed} <= {
        blocked.pose.bones["RightWrist"].path_from_id("rotation_quaternion")
    }
    assert np.abs(seen(blocked, [*range(-5, 2), *range(31, 70)]) - shown).max() < 1e-4
    steps = np.linalg.norm(np.diff(seen(blocked, range(1, 32)), axis=0), axis=-1).max(-1)
    assert steps.max() < 0.25 and done.report["shown_off_cm"] < 0.5
    for curve in playing(blocked):  # and between whole frames nothing is turned round
        if "rotation" in curve.data_path and len(curve.keyframe_points) > 10:
            halves = [curve.evaluate(f + 0.5) for f in range(2, 30)]
            wholes = [(curve.evaluate(f), curve.evaluate(f + 1)) for f in range(2, 30)]
            assert all(min(w) - 0.2 <= h <= max(w) + 0.2 for h, w in zip(halves, wholes, strict=True))


def test_several_poses_are_filled_in_one_go_and_each_is_reached(blocked):
    shown = seen(blocked, [1, 31, 61])
    done = filled(blocked, start=1, end=61)
    assert done.report["frames"] == 58
    assert np.abs(seen(blocked, [1, 31, 61]) - shown).max() < 1e-3
    again = filled(blocked, start=1, end=61, replace=True)
    assert again.report["frames"] == 59
    assert np.abs(seen(blocked, [1, 61]) - shown[[0, 2]]).max() < 1e-3
    assert np.abs(seen(blocked, [31]) - shown[1]).max() > 1e-3


def test_a_single_key_in_the_gap_is_kept_and_led_to(blocked):
    arm = blocked.pose.bones["RightElbow"]
    bpy.context.scene.frame_set(16)
    arm.rotation_quaternion = (0.7, 0.7, 0.1, 0.0)
    arm.keyframe_insert("rotation_quaternion", frame=16)
    path = arm.path_from_id("rotation_quaternion")
    theirs = {c.array_index: c.evaluate(16) for c in playing(blocked) if c.data_path == path}
    done = filled(blocked, start=1, end=31)
    assert done.report["kept"].startswith("Your key on RightElbow") and done.report["frames"] == 29
    curves = {c.array_index: c for c in playing(blocked) if c.data_path == path}
    assert {i: c.evaluate(16) for i, c in curves.items()} == pytest.approx(theirs)
    turns = np.array([[curves[i].evaluate(f) for i in range(4)] for f in range(1, 32)])
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    assert (np.abs((turns[1:] * turns[:-1]).sum(1)) > np.cos(0.15)).all()  # half of 17 degrees a frame
    filled(blocked, start=1, end=31, replace=True)
    curve = next(c for c in playing(blocked) if c.data_path == path and c.array_index == 1)
    assert abs(curve.evaluate(16) - theirs[1]) > 0.05


def test_stepped_keys_and_rigs_that_carry_their_way_on_the_object(blocked):
    for curve in playing(blocked):
        for key in curve.keyframe_points:
            key.interpolation = "CONSTANT"
    blocked.location = (0.0, 0.0, 0.0)
    blocked.keyframe_insert("location", frame=1)
    blocked.location = (1.0, 0.5, 0.0)
    blocked.keyframe_insert("location", frame=31)
    bpy.context.scene.frame_set(10)
    shown = seen(blocked, [0, 1, 31, 40])
    done = filled(blocked)
    assert np.abs(seen(blocked, [0, 1, 31, 40]) - shown).max() < 1e-3
    assert done.report["shown_off_cm"] < 0.5
    way = seen(blocked, range(1, 32))[:, 0]
    assert (
        np.linalg.norm(np.diff(way, axis=0), axis=1).max() < 0.2
    )  # the hips go on, however the object moves


def test_a_body_without_poses_on_one_side_is_told(blocked):
    for curve in playing(blocked):
        keys = read_keys(curve)
        write_keys(curve, taken(keys, keys["co"][:, 0] > 5))
    with pytest.raises(GapError, match="no keys before frame 10"):
        filled(blocked)
