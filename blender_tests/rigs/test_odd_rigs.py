"""Rigs that are odd: each acts all the same, or is refused with one sentence that names bones and mend."""

from __future__ import annotations

import bpy
import pytest
from foreign_rigs import MIXAMO, foreign_rig
from test_rig_skeleton import keyed, worst_angle

from nsm_blender.keys.layers import require_keyable
from nsm_blender.rigs.armature import Placement
from nsm_blender.rigs.bone_map import bone_map_of
from nsm_core.body.skeleton import JOINTS
from nsm_core.errors import NsmError


def edited(rig: bpy.types.Object, change) -> None:
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    change(rig.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")


def twist_between(bones) -> None:
    """A bone in the middle of the upper arm, on which the forearm hangs, as some exporters leave it."""
    for side in ("Left", "Right"):
        arm, lower = bones[side + "Arm"], bones[side + "ForeArm"]
        twist = bones.new(side + "ArmRoll")
        twist.head, twist.tail, twist.parent = (arm.head + lower.head) / 2, lower.head, arm
        lower.parent = twist


@pytest.mark.parametrize(
    "left_out",
    [("Collar",), ("Toe",), ("Neck",), ("Collar", "Toe", "Neck", "Chest3")],
    ids=lambda names: "+".join(names),
)
def test_who_lacks_bones_acts_with_those_that_are_there(left_out):
    names = {joint: bone for joint, bone in MIXAMO.items() if not joint.endswith(left_out)}
    rig = foreign_rig(names)
    found = dict(bone_map_of(rig).joints)
    assert set(found.values()) == set(names.values())
    heads, hips, local, _ = keyed(rig, found)
    assert worst_angle(heads, hips, local) < 0.1


def test_bones_between_two_joints_ride_along():
    rig = foreign_rig(MIXAMO)
    edited(rig, twist_between)
    rig.pose.bones["LeftArmRoll"].rotation_mode = "XYZ"
    rig.pose.bones["LeftArmRoll"].rotation_euler.y = 0.7  # somebody has turned it
    heads, hips, local, _ = keyed(rig, MIXAMO)
    assert worst_angle(heads, hips, local) < 0.1


def test_a_bone_scaled_by_hand_is_put_back_for_the_take():
    rig = foreign_rig(MIXAMO)
    rig.pose.bones["LeftUpLeg"].scale = (1.0, 1.4, 1.0)
    heads, hips, local, _ = keyed(rig, MIXAMO)
    assert worst_angle(heads, hips, local) < 0.1


def test_bones_without_words_that_slouch_act_by_their_shape():
    rig = foreign_rig({joint: f"Bone.{number:03d}" for number, joint in enumerate(JOINTS)}, slouch=0.3)
    heads, hips, local, _ = keyed(rig, dict(bone_map_of(rig).joints))
    assert worst_angle(heads, hips, local) < 0.1


def mirror(rig):
    rig.scale = (-1.0, 1.0, 1.0)
    return lambda: setattr(rig, "scale", (1.0, 1.0, 1.0))


def pull(rig):
    """An IK constraint on the shin, as on a rig whose makers left no preset."""
    constraint = rig.pose.bones["LeftLeg"].constraints.new("IK")
    constraint.target, constraint.subtarget, constraint.chain_count = rig, "root", 2
    return lambda: setattr(constraint, "mute", True)


def hang(rig):
    """A shin that hangs on the other side's thigh."""
    edited(rig, lambda bones: setattr(bones["LeftLeg"], "parent", bones["RightUpLeg"]))
    return lambda: edited(rig, lambda bones: setattr(bones["LeftLeg"], "parent", bones["LeftUpLeg"]))


def uneven(rig):
    rig.pose.bones["root"].scale = (1.0, 1.0, 2.0)
    return lambda: setattr(rig.pose.bones["root"], "scale", (1.0, 1.0, 1.0))


def rigid(rig):
    """A bone between two joints that does not turn with what it hangs on."""
    edited(rig, twist_between)
    rig.data.bones["LeftArmRoll"].use_inherit_rotation = False
    return lambda: setattr(rig.data.bones["LeftArmRoll"], "use_inherit_rotation", True)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (mirror, r"Rig is scaled unevenly or mirrored; apply its scale"),
        (pull, r"The constraint IK on its bone LeftLeg moves .*mute or remove it"),
        (hang, r"No bone of Rig was found for LeftKnee; choose the bones under Bones"),
        (uneven, r"The bone root of Rig is scaled unevenly.*clear its scale"),
        (rigid, r"The bone LeftArmRoll of Rig .*switch Inherit Rotation on"),
    ],
)
def test_what_keys_cannot_rule_is_refused_and_can_be_mended(spoil, told):
    rig = foreign_rig(MIXAMO)
    mend = spoil(rig)
    bpy.context.view_layer.update()
    with pytest.raises(NsmError, match=told) as refused:
        Placement.of(rig)
        require_keyable(rig)
    assert str(refused.value).endswith(".") and len(str(refused.value)) < 300
    mend()
    bpy.context.view_layer.update()
    Placement.of(rig)
    require_keyable(rig)
