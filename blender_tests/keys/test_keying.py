"""Keys read back from the action, frame by frame, against the core's own kinematics."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from foreign_rigs import remove_bones
from mathutils import Matrix
from motions import blender_heads, wandering_take

from nsm_blender.animation.channels import GENERATED, channels_of
from nsm_blender.animation.rate import scene_fps
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import key_take, read_back, resample_take
from nsm_blender.rigs.armature import build_armature, read_pose
from nsm_core.body.skeleton import JOINTS, OFFSETS, J, forward_kinematics
from nsm_core.errors import NsmError, SkeletonError


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    # Exact for small angles, unlike the arc cosine.
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return 4 * np.arcsin(np.minimum(chord / 2, 1))


PLACES = {
    "at the origin": Matrix.Identity(4),
    "moved": Matrix.Translation((3, -2, 0.5)),
    "turned": Matrix.Translation((-1, 0, 0)) @ Matrix.Rotation(2.1, 4, "Z"),
    "tilted": Matrix.Rotation(0.7, 4, (1, 2, 3)),
    "scaled": Matrix.Translation((1, 1, 0)) @ Matrix.Rotation(-1.0, 4, "Z") @ Matrix.Scale(0.6, 4),
}


@pytest.mark.parametrize("place", PLACES)
def test_joints_land_in_the_world_wherever_the_armature_stands(place):
    armature = build_armature("Character")
    armature.matrix_world = PLACES[place]
    scale = 0.6 if place == "scaled" else 1.0
    bpy.context.scene.render.fps = 30
    hips, local = wandering_take()
    take = key_take(armature, hips, local, frame_start=5)
    assert (take.frame_start, take.frame_end) == (5, 44)
    expected, _ = forward_kinematics(hips, local, OFFSETS.astype(float) * scale)
    assert np.abs(blender_heads(armature, range(5, 45)) - expected).max() < 1e-4
    read_hips, read_local = read_back(armature, range(5, 45))
    assert np.abs(read_hips - hips).max() < 1e-4
    assert angle_between(read_local, local).max() < 1e-4
    assert np.allclose(armature.matrix_world, PLACES[place], atol=1e-6), (
        "the armature's own transform is untouched"
    )


@pytest.mark.parametrize(("fps", "base"), [(24, 1.0), (25, 1.0), (60, 1.0), (30, 1.001), (24, 1.001)])
def test_the_scene_rate_is_honoured(fps, base):
    armature = build_armature("Character")
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = fps, base
    assert scene_fps(scene) == pytest.approx(fps / base)
    hips, local = wandering_take(61)  # two seconds
    take = key_take(armature, hips, local, frame_start=10)
    frames = range(take.frame_start, take.frame_end + 1)
    assert (len(frames) - 1) / scene_fps(scene) == pytest.approx(2.0, abs=1.001 / scene_fps(scene))
    assert (len(frames) - 1) / scene_fps(scene) >= 2.0 - 1e-6
    read_hips, read_local = read_back(armature, frames)
    assert np.abs(read_hips[0] - hips[0]).max() < 1e-4
    assert np.abs(read_hips[-1] - hips[-1]).max() < 1e-4
    for k, frame in enumerate(frames):  # every scene frame against the two network frames around its time
        time = min((frame - 10) / scene_fps(scene) * 30, 60)
        i, t = min(int(time), 59), time - min(int(time), 59)
        assert np.abs(read_hips[k] - ((1 - t) * hips[i] + t * hips[i + 1])).max() < 1e-4
        step = angle_between(local[i], local[i + 1])
        assert np.all(angle_between(local[i], read_local[k]) <= step * t + 1e-4)
        assert np.all(angle_between(local[i + 1], read_local[k]) <= step * (1 - t) + 1e-4)


def test_resampling_at_the_same_rate_changes_nothing():
    hips, local = wandering_take(20)
    again_hips, again_local = resample_take(hips, local, 30, 30)
    assert np.abs(again_hips - hips).max() < 1e-12
    assert angle_between(again_local, local).max() < 1e-6


def test_a_single_frame_can_be_keyed():
    armature = build_armature("Character")
    hips, local = wandering_take(1)
    take = key_take(armature, hips, local, frame_start=3)
    assert take.frame_start == take.frame_end == 3
    assert np.abs(read_back(armature, [3])[0] - hips).max() < 1e-4


def test_no_quaternion_flips_between_frames():
    armature = build_armature("Character")
    hips, local = wandering_take(90)
    local[::2] *= -1  # the same rotations on alternating covers
    key_take(armature, hips, local)
    for fcurve in channels_of(armature).bag.fcurves:
        values = np.array([k.co.y for k in fcurve.keyframe_points])
        if "quaternion" in fcurve.data_path:
            assert np.abs(np.diff(values)).max() < 0.5


def test_a_new_action_in_groups_with_generated_keys():
    armature = build_armature("Character")
    hips, local = wandering_take()
    take = key_take(armature, hips, local, name="Sit on Chair")
    assert take.action.name == "Sit on Chair" and armature.animation_data.action == take.action
    bag = channels_of(armature).bag
    assert {f.group.name for f in bag.fcurves} == set(JOINTS)
    assert len(bag.fcurves) == 4 * J + 3
    if hasattr(take.action, "slots"):
        assert armature.animation_data.action_slot == take.slot and len(take.action.slots) == 1
    kinds = np.empty(len(bag.fcurves[0].keyframe_points), np.intc)
    bag.fcurves[0].keyframe_points.foreach_get("type", kinds)
    assert set(kinds) == {GENERATED}


def test_the_previous_action_is_kept_with_its_keys():
    armature = build_armature("Character")
    hips, local = wandering_take()
    first = key_take(armature, hips, local, name="Mine")
    before = read_back(armature, range(1, 20))
    second = key_take(armature, hips + (1, 0, 0), local, name="Mine")
    assert second.previous_action == first.action != second.action
    assert first.action.use_fake_user and second.action.name == "Mine.001"
    armature.animation_data.action = first.action
    if first.slot:
        armature.animation_data.action_slot = first.slot
    after = read_back(armature, range(1, 20))
    assert np.abs(after[0] - before[0]).max() < 1e-6 and np.abs(after[1] - before[1]).max() < 1e-6


def test_a_discarded_take_leaves_no_trace():
    armature = build_armature("Character")
    hips, local = wandering_take()
    first = key_take(armature, hips, local, name="Mine")
    before = read_back(armature, range(1, 20))
    discard_take(key_take(armature, hips + (1, 0, 0), local, name="Other"))
    assert [a.name for a in bpy.data.actions] == ["Mine"]
    assert armature.animation_data.action == first.action and not first.action.use_fake_user
    assert np.abs(read_back(armature, range(1, 20))[0] - before[0]).max() < 1e-6


def test_a_discarded_first_take_gives_the_pose_back():
    armature = build_armature("Character")
    armature.pose.bones["LeftElbow"].rotation_quaternion = (0.8, 0.6, 0, 0)
    hips, local = wandering_take()
    discard_take(key_take(armature, hips, local))
    assert armature.animation_data.action is None and not bpy.data.actions
    assert list(armature.pose.bones["LeftElbow"].rotation_quaternion) == pytest.approx(
        (0.8, 0.6, 0, 0), abs=1e-5
    )
    assert list(armature.pose.bones["Hips"].location) == pytest.approx((0, 0, 0), abs=1e-6)


@pytest.mark.parametrize("mode", ["XYZ", "ZYX", "AXIS_ANGLE"])
def test_other_rotation_modes_are_kept_and_keyed(mode):
    armature = build_armature("Character")
    for name in ("Hips", "LeftShoulder", "RightKnee"):
        armature.pose.bones[name].rotation_mode = mode
    bpy.context.scene.render.fps = 30
    hips, local = wandering_take()
    key_take(armature, hips, local)
    assert armature.pose.bones["Hips"].rotation_mode == mode
    expected, _ = forward_kinematics(hips, local, OFFSETS.astype(float))
    assert np.abs(blender_heads(armature, range(1, 41)) - expected).max() < 1e-4


def test_hand_moved_bones_and_a_posed_root_bone_do_not_bend_the_take():
    armature = build_armature("Character")
    bpy.ops.object.mode_set(mode="EDIT")
    root = armature.data.edit_bones.new("root")
    root.head, root.tail = (0, 0, 0), (0, 0.3, 0)
    armature.data.edit_bones["Hips"].parent = root
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.pose.bones["root"].location = (0.5, 0.2, -0.1)
    armature.pose.bones["root"].rotation_quaternion = (0.9, 0.1, 0.4, 0.1)
    armature.pose.bones["Chest2"].location = (0, 0.1, 0)
    armature.pose.bones["LeftShoulder"].scale = (1.5, 1.5, 1.5)
    bpy.context.scene.render.fps = 30
    hips, local = wandering_take()
    key_take(armature, hips, local)
    expected, _ = forward_kinematics(hips, local, OFFSETS.astype(float))
    assert np.abs(blender_heads(armature, range(1, 41)) - expected).max() < 1e-4


def test_the_start_is_read_from_the_pose_in_the_world():
    armature = build_armature("Character")
    armature.matrix_world = (
        Matrix.Translation((2, -3, 0)) @ Matrix.Rotation(math.radians(50), 4, "Z") @ Matrix.Scale(1.2, 4)
    )
    start = read_pose(armature)
    assert start.position == pytest.approx((2, -3), abs=1e-5)
    assert math.degrees(start.heading) == pytest.approx(50, abs=1e-3)
    assert start.scale == pytest.approx(1.2, abs=1e-5)
    hips, local = wandering_take()
    key_take(armature, hips, local)
    moved = read_pose(armature)
    assert moved.position == pytest.approx(hips[0, :2], abs=1e-4)
    assert angle_between(moved.local_rotations, local[0]).max() < 1e-4


def test_renamed_bones_are_found_and_missing_ones_listed():
    armature = build_armature("Character")
    armature.data.bones["LeftKnee"].name = "Knee.L"
    armature.data.bones["Neck"].name = "neck"
    hips, local = wandering_take()
    discard_take(key_take(armature, hips, local))
    remove_bones(armature, "Knee.L", "RightElbow")
    with pytest.raises(SkeletonError, match="RightElbow, LeftKnee"):
        key_take(armature, hips, local)
    assert not bpy.data.actions


def test_other_objects_wrong_parents_and_uneven_scale_are_refused():
    hips, local = wandering_take()
    empty = bpy.data.objects.new("Empty", None)
    with pytest.raises(SkeletonError, match="Empty is not an armature"):
        key_take(empty, hips, local)
    armature = build_armature("Character")
    armature.scale = (1, 2, 1)
    with pytest.raises(SkeletonError, match="scaled unevenly"):
        key_take(armature, hips, local)
    armature.scale = (1, 1, -1)
    with pytest.raises(SkeletonError, match="mirrored"):
        key_take(armature, hips, local)
    armature.scale = (1, 1, 1)
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones["LeftKnee"].parent = armature.data.edit_bones["Hips"]
    bpy.ops.object.mode_set(mode="OBJECT")
    with pytest.raises(SkeletonError, match="LeftKnee"):
        key_take(armature, hips, local)


def test_a_take_with_nan_keys_nothing():
    armature = build_armature("Character")
    hips, local = wandering_take()
    hips[7, 2] = np.nan
    with pytest.raises(NsmError, match="not numbers"):
        key_take(armature, hips, local)
    assert not bpy.data.actions
