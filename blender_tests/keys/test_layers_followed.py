"""What else moves a character and can be followed: its keys land in the world all the same."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from layers import bones_of, pushed_down, slide, with_root
from mathutils import Matrix
from motions import blender_heads, wandering_take
from scenes import empty

from nsm_blender.keys.keying import key_take
from nsm_blender.keys.layers import require_keyable
from nsm_blender.rigs.armature import build_armature
from nsm_core.body.skeleton import OFFSETS, forward_kinematics


@pytest.fixture
def armature():
    bpy.context.scene.render.fps = 30
    return build_armature("Hero")


def assert_lands(armature, **options):
    """Key a take and compare the bones that the scene evaluates with it, frame by frame."""
    hips, local = wandering_take()
    require_keyable(armature)
    take = key_take(armature, hips, local, **options)
    expected, _ = forward_kinematics(hips, local, OFFSETS.astype(float))
    assert np.abs(blender_heads(armature, range(1, 41)) - expected).max() < 2e-4
    return take


def animated_parent(armature):
    armature.parent = empty("Cart", (0, 0, 0))
    armature.matrix_parent_inverse = Matrix.Translation((0.3, 0, 0))
    slide(armature.parent)


def child_of(armature):
    cart = empty("Cart", (0, 0, 0))
    slide(cart)
    armature.constraints.new("CHILD_OF").target = cart


def parent_that_copies(armature):
    cart = empty("Cart", (0, 0, 0))
    slide(cart)
    armature.parent = empty("Follower", (0, 0, 0))
    armature.parent.constraints.new("COPY_TRANSFORMS").target = cart


def object_strip(armature):
    slide(armature)
    pushed_down(armature)


def object_action(armature):
    slide(armature)
    bpy.context.scene.frame_set(12)


def object_driver(armature):
    driver = armature.driver_add("location", 0).driver
    driver.expression = "frame * 0.05"


def deltas(armature):
    armature.delta_location, armature.delta_rotation_euler = (1, 2, 0.5), (0.2, 0.1, 0.7)


def strip_under_the_bones(armature):
    for bone in bones_of(armature, "LeftKnee", "Hips", "Chest"):
        slide(bone, (0.1, 0.2, 0.1))
        bone.scale = (1.5, 1.2, 1.1)
        bone.keyframe_insert("scale", frame=1)
    pushed_down(armature)
    for bone in bones_of(armature, "LeftKnee", "Hips", "Chest"):
        bone.location, bone.scale = (0, 0, 0), (1, 1, 1)


def root_on_a_strip(armature):
    slide(with_root(armature), (0.4, 0.3, 0.2))
    pushed_down(armature)


def root_held_by_a_constraint(armature):
    cart = empty("Cart", (0, 0, 0))
    slide(cart)
    with_root(armature).constraints.new("COPY_TRANSFORMS").target = cart


def root_without_inheritance(armature):
    slide(with_root(armature), (0.4, 0.3, 0.2))
    pushed_down(armature)
    armature.data.bones["Hips"].use_inherit_rotation = False


def hips_in_armature_axes(armature):
    slide(with_root(armature), (0.4, 0.3, 0.2))
    pushed_down(armature)
    armature.data.bones["Hips"].use_local_location = False


def scaled_root(armature):
    with_root(armature).scale = (0.5, 0.5, 0.5)
    armature.scale = (2, 2, 2)
    for scaled in ("Hips",):
        armature.data.bones[scaled].inherit_scale = "FULL"


def loose_bones(armature):
    armature.rotation_euler, armature.location = (0.3, 0.2, 1.0), (1, 1, 0)
    for name in ("Chest2", "LeftShoulder", "RightKnee", "LeftWrist", "Head"):
        armature.data.bones[name].use_inherit_rotation = False


def bone_between(armature):
    extra = with_root(armature, "LeftKnee")
    extra.rotation_mode = "XYZ"
    extra.rotation_euler, extra.location = (0.5, 0.2, 0.1), (0, 0.1, 0)


def locks(armature):
    for bone in armature.pose.bones:
        bone.lock_location, bone.lock_rotation, bone.lock_rotation_w = (True,) * 3, (True,) * 3, True


def stretched_time(armature):
    animated_parent(armature)
    bpy.context.scene.render.frame_map_new = 100


def nla_off(armature):
    slide(armature.pose.bones["Chest"], (0, 0, 0))
    track, _ = pushed_down(armature)
    track.is_solo = True
    armature.animation_data.use_nla = False


def combine_without_tracks(armature):
    armature.animation_data_create().action_blend_type = "ADD"
    armature.animation_data.action_influence = 0.3


def what_moves_nothing(armature):
    """Constraints and drivers that are muted, without influence or target, on other bones, or on channels not
    in use.
    """
    extra = with_root(armature)
    bones = armature.data.edit_bones
    bpy.ops.object.mode_set(mode="EDIT")
    helper = bones.new("helper")
    helper.head, helper.tail, helper.parent = (0, 0, 0.1), (0, 0, 0), bones["LeftAnkle"]
    bpy.ops.object.mode_set(mode="OBJECT")
    knee, helper = bones_of(armature, "LeftKnee", "helper")
    mark = empty("Mark", (1, 1, 1))
    muted, weak = knee.constraints.new("COPY_LOCATION"), knee.constraints.new("COPY_ROTATION")
    muted.target = weak.target = mark
    muted.mute, weak.influence = True, 0.0
    knee.constraints.new("DAMPED_TRACK")  # no target
    knee.constraints.new("ARMATURE")
    helper.constraints.new("COPY_LOCATION").target = mark
    ik = helper.constraints.new("IK")
    ik.target, ik.chain_count = mark, 1
    helper.driver_add("location", 0).driver.expression = "frame"
    knee.driver_add("rotation_euler", 0).driver.expression = "1"  # the bone turns by its quaternion
    armature.pose.bones["Chest"].driver_add("location", 0).mute = True
    assert extra.bone.name == "extra"


FOLLOWED = (
    animated_parent, child_of, parent_that_copies, object_strip, object_action, object_driver, deltas,
    strip_under_the_bones, root_on_a_strip, root_held_by_a_constraint, root_without_inheritance,
    hips_in_armature_axes, scaled_root, loose_bones, bone_between, locks, stretched_time, nla_off,
    combine_without_tracks, what_moves_nothing,
)  # fmt: skip


@pytest.mark.parametrize("layer", FOLLOWED, ids=lambda f: f.__name__)
def test_keys_follow_what_carries_the_character(armature, layer):
    layer(armature)
    assert_lands(armature)


def test_the_frame_comes_back_from_a_character_that_is_carried(armature):
    animated_parent(armature)
    scene = bpy.context.scene
    scene.frame_set(17, subframe=0.25)
    assert_lands(armature)
    hips, local = wandering_take()
    scene.frame_set(17, subframe=0.25)
    key_take(armature, hips, local)
    assert (scene.frame_current, scene.frame_subframe) == (17, 0.25)
