"""What else moves a character: followed by its keys, or refused in a sentence that names it, before anything is made."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scenes import empty
from test_keying import blender_heads, wandering_take

from nsm_blender.armature import build_armature
from nsm_blender.keying import key_take
from nsm_blender.layers import require_keyable
from nsm_blender.things import require_movable
from nsm_core.errors import GoalError, NsmError
from nsm_core.skeleton import OFFSETS, forward_kinematics


@pytest.fixture
def armature():
    bpy.context.scene.render.fps = 30
    return build_armature("Hero")


def bones_of(armature, *names):
    return [armature.pose.bones[name] for name in names]


def with_root(armature, between: str | None = None):
    """Give the rig a root bone over the hips, or a bone between ``between`` and its parent."""
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    extra = bones.new("extra")
    child = bones[between or "Hips"]
    extra.head, extra.tail, extra.roll = child.head + child.vector * 0.1, child.tail, 0.7
    extra.parent, child.parent = child.parent, extra
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature.pose.bones["extra"]


def slide(moving, to=(2.0, 0.5, 0.3), turn=1.0):
    """Key an object, or a bone, on its way and turning."""
    moving.rotation_mode = "XYZ"
    for frame, share in ((1, 0.0), (30, 1.0)):
        moving.location = np.array(to) * share
        moving.rotation_euler = (0.2 * share, 0.1 * share, turn * share)
        moving.keyframe_insert("location", frame=frame)
        moving.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)


def pushed_down(target, name="below"):
    data = target.animation_data
    track = data.nla_tracks.new()
    track.name = name
    strip = track.strips.new(name, 1, data.action)
    data.action = None
    return track, strip


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
    """Constraints and drivers that are muted, without influence or target, on other bones, or on channels not in use."""
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
    animated_parent, child_of, parent_that_copies, object_strip, object_action, object_driver, deltas, strip_under_the_bones,
    root_on_a_strip, root_held_by_a_constraint, root_without_inheritance, hips_in_armature_axes, scaled_root, loose_bones, bone_between,
    locks, stretched_time, nla_off, combine_without_tracks, what_moves_nothing,
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


# --- refused ------------------------------------------------------------------------------------------------------------


def ik_on_a_joint(armature):
    ik = armature.pose.bones["LeftKnee"].constraints.new("IK")
    ik.target, ik.chain_count = empty("Mark", (1, 1, 1)), 2


def ik_from_a_helper(armature):
    bpy.ops.object.mode_set(mode="EDIT")
    helper = armature.data.edit_bones.new("helper")
    helper.head, helper.tail = (0.1, 0, 0.1), (0.1, 0, 0)
    helper.parent = armature.data.edit_bones["LeftAnkle"]
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.pose.bones["helper"].constraints.new("IK").target = empty("Mark", (1, 1, 1))


def limit(armature):
    armature.pose.bones["RightElbow"].constraints.new("LIMIT_ROTATION").use_limit_x = True


def armature_constraint(armature):
    target = armature.pose.bones["Neck"].constraints.new("ARMATURE").targets.new()
    target.target, target.subtarget = armature, "Hips"


def weak_but_keyed(armature):
    constraint = armature.pose.bones["Head"].constraints.new("COPY_ROTATION")
    constraint.target, constraint.influence = empty("Mark", (1, 1, 1)), 0.0
    constraint.keyframe_insert("influence", frame=1)
    pushed_down(armature)


def weak_but_driven(armature):
    constraint = armature.pose.bones["Head"].constraints.new("COPY_ROTATION")
    constraint.target, constraint.influence = empty("Mark", (1, 1, 1)), 0.0
    constraint.driver_add("influence").driver.expression = "frame / 40"


def between_held(armature):
    with_root(armature, "LeftKnee").constraints.new("COPY_ROTATION").target = empty("Mark", (1, 1, 1))


def loose_bone_between(armature):
    with_root(armature, "RightShoulder").bone.use_inherit_rotation = False


def driver_on_location(armature):
    armature.pose.bones["Hips"].driver_add("location", 1).driver.expression = "0.2"


def driver_on_rotation(armature):
    armature.pose.bones["Chest"].driver_add("rotation_quaternion", 0).driver.expression = "1"


def driver_on_scale(armature):
    armature.pose.bones["Neck"].driver_add("scale", 0).driver.expression = "2"


def solo(armature):
    slide(armature.pose.bones["Chest"], (0, 0, 0))
    pushed_down(armature, "idle")[0].is_solo = True


def solo_of_an_empty_track(armature):
    armature.animation_data_create().nla_tracks.new().is_solo = True


def combined(armature):
    slide(armature.pose.bones["Chest"], (0, 0, 0))
    pushed_down(armature)
    armature.animation_data.action_blend_type = "COMBINE"


def half_influence(armature):
    slide(armature.pose.bones["Chest"], (0, 0, 0))
    pushed_down(armature)
    armature.animation_data.action_influence = 0.5


def tweak(armature):
    slide(armature.pose.bones["Chest"], (0, 0, 0))
    track, strip = pushed_down(armature)
    track.select = strip.select = True
    armature.animation_data.nla_tracks.active = track
    armature.animation_data.use_tweak_mode = True


def rest(armature):
    armature.data.pose_position = "REST"


def switched_off(armature):
    armature.hide_viewport = True


def growing(armature):
    for frame, size in ((1, 1.0), (20, 2.0)):
        armature.scale = (size,) * 3
        armature.keyframe_insert("scale", frame=frame)
    pushed_down(armature)


def growing_parent(armature):
    armature.parent = empty("Balloon", (0, 0, 0))
    armature.parent.driver_add("scale", 0).driver.expression = "1 + frame / 20"


def uneven_root(armature):
    with_root(armature).scale = (1, 2, 1)


REFUSED = {
    ik_on_a_joint: "IK.*LeftKnee.*mute",
    ik_from_a_helper: "IK.*helper.*moves LeftAnkle.*mute",
    limit: "Limit Rotation.*RightElbow",
    armature_constraint: "Armature.*Neck",
    weak_but_keyed: "Copy Rotation.*Head",
    weak_but_driven: "Copy Rotation.*Head",
    between_held: "Copy Rotation.*extra",
    loose_bone_between: "extra.*Inherit Rotation",
    driver_on_location: "Hips.*driver.*location",
    driver_on_rotation: "Chest.*driver.*rotation quaternion",
    driver_on_scale: "Neck.*driver.*scale",
    solo: "track idle of Hero is solo.*star",
    solo_of_an_empty_track: "solo.*star",
    combined: "Combine.*Replace",
    half_influence: "influence 0.50.*Influence to 1",
    tweak: "tweak mode.*Tab",
    rest: "rest position.*Pose Position",
    switched_off: "switched off.*show it",
    growing: "Hero changes its size.*scale",
    growing_parent: "Balloon.*remove",
    uneven_root: "extra.*unevenly.*Alt\\+S",
}


@pytest.mark.parametrize("layer", REFUSED, ids=lambda f: f.__name__)
def test_what_keys_cannot_rule_is_refused_by_its_name(armature, layer):
    layer(armature)
    bpy.context.view_layer.update()
    had = len(bpy.data.actions)
    with pytest.raises(NsmError, match=REFUSED[layer]) as raised:
        require_keyable(armature)
    assert str(raised.value).endswith(".")
    with pytest.raises(NsmError):
        key_take(armature, *wandering_take())
    assert len(bpy.data.actions) == had


def moved_thing():
    thing = bpy.data.objects.new("Box", bpy.data.meshes.new("Box"))
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    return thing


def test_things_are_held_to_the_same_rules():
    thing = moved_thing()
    thing.constraints.new("COPY_LOCATION")  # no target
    constraint = thing.constraints.new("COPY_ROTATION")
    constraint.target, constraint.influence = empty("Mark", (1, 1, 1)), 0.0
    require_movable(thing, None)
    constraint.driver_add("influence").driver.expression = "1"
    with pytest.raises(GoalError, match="Box has constraints.*Copy Rotation"):
        require_movable(thing, None)


@pytest.mark.parametrize("how", ["solo", "combine", "driver", "unused driver", "delta strip", "hidden"])
def test_a_thing_whose_keys_would_not_rule_is_refused(how):
    thing = moved_thing()
    if how in ("solo", "combine", "delta strip"):
        for frame in (1, 20):
            thing.delta_location.x = frame
            thing.keyframe_insert("delta_location" if how == "delta strip" else "location", frame=frame)
        track, _ = pushed_down(thing)
        track.is_solo = how == "solo"
        thing.animation_data.action_blend_type = "COMBINE" if how == "combine" else "REPLACE"
    elif "driver" in how:
        thing.driver_add("rotation_quaternion" if how == "unused driver" else "delta_location", 0).driver.expression = "1"
    else:
        thing.hide_viewport = True
    bpy.context.view_layer.update()
    if how == "unused driver":
        require_movable(thing, None)
        return
    with pytest.raises(NsmError, match="Box"):
        require_movable(thing, None)
