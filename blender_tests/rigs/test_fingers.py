"""Fingers: found under hands, bent towards the palm, keyed by a few keys that ease."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from foreign_rigs import MIXAMO, foreign_rig
from motions import wandering_take

from nsm_blender.animation.channels import curves_in
from nsm_blender.keys.fingers import key_fingers
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import key_take
from nsm_blender.rigs.armature import Placement
from nsm_blender.rigs.bone_map import BoneMap, bone_map_of
from nsm_blender.rigs.fingers import FIST, FLAT, RELAXED, bent, fingers_of
from nsm_blender.rigs.presets import load_preset, save_preset
from nsm_core.control.goals import GoalResult
from nsm_core.control.take import TakeResult
from nsm_core.conventions import CONTACTS
from nsm_core.errors import SkeletonError

FINGERS = {"Thumb": (-0.04, 2, 0.03), "Index": (-0.025, 3, 0.03), "Pinky": (0.025, 3, 0.02)}


@pytest.fixture
def rig():
    """A Mixamo body in a T-pose whose hands have a thumb ahead and two straight fingers."""
    made = foreign_rig(MIXAMO)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = made.data.edit_bones
    for side, sign in (("Left", 1), ("Right", -1)):
        hand = bones[side + "Hand"]
        for name, (aside, count, length) in FINGERS.items():
            above, at = (
                hand,
                hand.head + type(hand.head)((sign * (0.03 if name == "Thumb" else 0.08), aside, 0)),
            )
            way = type(hand.head)((sign * length, -length if name == "Thumb" else 0, 0))
            for k in range(count):
                bone = bones.new(f"{side}Hand{name}{k + 1}")
                bone.head, bone.tail, bone.parent = at, at + way, above
                above, at = bone, at + way
    twist = bones.new("LeftHandTwist")
    twist.head, twist.tail, twist.parent = bones["LeftHand"].head, bones["LeftHand"].tail, bones["LeftHand"]
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.scene.render.fps = 30
    return made


def test_fingers_are_found_and_what_else_hangs_on_a_hand_is_not(rig):
    found = {finger.bones[0]: finger for finger in fingers_of(rig, bone_map_of(rig))}
    assert set(found) == {f"{side}Hand{name}1" for side in ("Left", "Right") for name in FINGERS}
    assert found["LeftHandThumb1"].thumb and found["LeftHandThumb1"].side == 1
    assert found["RightHandPinky1"].bones == tuple(f"RightHandPinky{k}" for k in (1, 2, 3))


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_they_bend_towards_the_palm_and_a_fist_more_than_a_flat_hand(rig, side):
    drops = {}
    for shape in (RELAXED, FLAT, FIST):
        for name, turn in bent(rig, fingers_of(rig, bone_map_of(rig)), shape).items():
            rig.pose.bones[name].rotation_mode = "QUATERNION"
            rig.pose.bones[name].rotation_quaternion = turn
        bpy.context.view_layer.update()
        first, last = (rig.pose.bones[f"{side}HandIndex{k}"] for k in (1, 3))
        drops[shape] = first.head.z - last.tail.z
    assert 0 < drops[FLAT] < drops[RELAXED] and drops[FIST] > 0.02


def test_fingers_close_while_a_handle_is_held_and_go_back(rig):
    hips, local = wandering_take(60)
    take = key_take(rig, hips * Placement.of(rig).scale, local)
    contacts = np.zeros((60, len(CONTACTS)))
    contacts[20:40, CONTACTS.index("LeftWrist")] = 1
    goal = GoalResult("Door", "open", start_frame=0, end_frame=59)
    nothing = np.zeros((60, 0))
    key_fingers(take, TakeResult(hips, local, hips, local, contacts, nothing, nothing, nothing, [goal], {}))
    bend = {}
    for frame in (5, 30, 58):
        bpy.context.scene.frame_set(frame)
        bend[frame] = rig.pose.bones["LeftHandIndex1"].matrix_basis.to_quaternion().angle
    assert np.degrees(bend[30]) == pytest.approx(52, abs=1) and np.degrees(bend[5]) < 20
    assert bend[58] == pytest.approx(bend[5], abs=1e-3)
    curves = [c for c in curves_in(take.action, take.slot) if "LeftHandIndex1" in c.data_path]
    assert all(len(c.keyframe_points) <= 5 for c in curves)
    still = [c for c in curves_in(take.action, take.slot) if "RightHandIndex1" in c.data_path]
    assert still and all(len(c.keyframe_points) == 1 for c in still)
    discard_take(take)
    assert rig.pose.bones["LeftHandIndex1"].matrix_basis.to_quaternion().angle < 1e-6


def test_fingers_of_controls_stand_in_a_preset(rig, tmp_path):
    listed = {"LeftIndex": ("LeftHandIndex1", "LeftHandIndex2")}
    save_preset(tmp_path / "own.toml", BoneMap(MIXAMO, fingers=listed))
    bone_map = load_preset(tmp_path / "own.toml").on(rig.data.bones)
    assert bone_map.fingers == listed
    assert [f.bones for f in fingers_of(rig, bone_map) if f.side == 1] == [listed["LeftIndex"]]
    (tmp_path / "own.toml").write_text('[fingers]\nIndex = ["a"]\n')
    with pytest.raises(SkeletonError, match="must begin with Right or Left"):
        load_preset(tmp_path / "own.toml")
