"""What else moves a character and cannot be followed: refused in a sentence that names it, before anything is
made.
"""

from __future__ import annotations

import bpy
import pytest
from layers import pushed_down, slide, with_root
from motions import wandering_take
from scenes import empty

from nsm_blender.keys.keying import key_take
from nsm_blender.keys.layers import require_keyable
from nsm_blender.rigs.armature import build_armature
from nsm_core.errors import NsmError


@pytest.fixture
def armature():
    bpy.context.scene.render.fps = 30
    return build_armature("Hero")


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


def driven_inheritance(armature):
    armature.data.driver_add('bones["Chest"].use_inherit_rotation').driver.expression = "frame < 10"


def driven_rest(armature):
    armature.data.driver_add("pose_position").driver.expression = "0 if frame < 10 else 1"


def keyed_rest(armature):
    for frame, position in ((1, "REST"), (20, "POSE")):
        armature.data.pose_position = position
        armature.data.keyframe_insert("pose_position", frame=frame)


REFUSED = {
    driven_inheritance: "Hero is animated .use inherit rotation of its bone Chest.*remove that driver",
    driven_rest: "Hero is animated .pose position",
    keyed_rest: "Hero is animated .pose position",
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


def copied_scale(armature, owner):
    balloon = empty("Balloon", (0, 0, 0))
    for frame, size in ((1, 1.0), (20, 2.0)):
        balloon.scale = (size,) * 3
        balloon.keyframe_insert("scale", frame=frame)
    owner.constraints.new("COPY_SCALE").target = balloon


def object_copies_a_scale(armature):
    copied_scale(armature, armature)


def root_copies_a_scale(armature):
    copied_scale(armature, with_root(armature))


def parent_copies_a_scale(armature):
    armature.parent = empty("Cart", (0, 0, 0))
    copied_scale(armature, armature.parent)


def root_grows_on_a_strip(armature):
    root = with_root(armature)
    for frame, size in ((1, 1.0), (20, 2.0)):
        root.scale = (size,) * 3
        root.keyframe_insert("scale", frame=frame)
    pushed_down(armature)


def root_driven_to_grow(armature):
    root = with_root(armature)
    for axis in range(3):
        root.driver_add("scale", axis).driver.expression = "1 + frame / 20"


@pytest.mark.parametrize(
    "layer",
    [
        object_copies_a_scale,
        root_copies_a_scale,
        parent_copies_a_scale,
        root_grows_on_a_strip,
        root_driven_to_grow,
    ],
    ids=lambda f: f.__name__,
)
def test_a_size_that_changes_by_whatever_means_is_refused_with_nothing_keyed(armature, layer):
    layer(armature)
    bpy.context.scene.frame_set(1)
    had = len(bpy.data.actions)
    with pytest.raises(NsmError, match="Hero changes its size during the take"):
        key_take(armature, *wandering_take())
    assert len(bpy.data.actions) == had
