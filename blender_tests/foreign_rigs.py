"""Rigs of other makers, made in the test: names, rest pose, rolls and proportions as asked for."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from nsm_core.body.skeleton import END_SITES, INDEX, JOINTS, OFFSETS, PARENTS, J, forward_kinematics
from nsm_core.rotations import quat_from_axis_angle

MIXAMO = {
    "Hips": "Hips", "Chest": "Spine", "Chest3": "Spine1", "Chest4": "Spine2", "Neck": "Neck", "Head": "Head",
    **{
        side + ours: side + theirs
        for side in ("Left", "Right")
        for ours, theirs in (
            ("Collar", "Shoulder"), ("Shoulder", "Arm"), ("Elbow", "ForeArm"), ("Wrist", "Hand"),
            ("Hip", "UpLeg"), ("Knee", "Leg"), ("Ankle", "Foot"), ("Toe", "ToeBase"),
        )
    },
}  # fmt: skip
# A body that is not ours: short legs, long arms, a wide chest.
PROPORTIONS = {"Knee": 0.7, "Ankle": 0.75, "Elbow": 1.3, "Wrist": 1.2, "Shoulder": 1.25, "Chest2": 1.2}


def remove_bones(armature: bpy.types.Object, *names: str) -> None:
    """Delete bones of an armature; what hung on them hangs on nothing."""
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name in names:
        armature.data.edit_bones.remove(armature.data.edit_bones[name])
    bpy.ops.object.mode_set(mode="OBJECT")


def own_offsets() -> np.ndarray:
    """Offsets (23, 3) of a body with ``PROPORTIONS``, metres."""
    offsets = OFFSETS.astype(np.float64)
    for j, name in enumerate(JOINTS):
        for part, share in PROPORTIONS.items():
            if name.endswith(part):
                offsets[j] = offsets[j] * share
    return offsets


def rest_places(
    offsets: np.ndarray, arms: float = 0.0, elbows: float = 0.0, slouch: float = 0.0
) -> np.ndarray:
    """Joints (23, 3) of a rest pose, arms lowered, elbows bent forward and the trunk bowed by radians."""
    local = np.tile((1.0, 0.0, 0.0, 0.0), (J, 1))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        local[INDEX[side + "Shoulder"]] = quat_from_axis_angle(np.array((0, 1.0, 0)), sign * arms)
        local[INDEX[side + "Elbow"]] = quat_from_axis_angle(np.array((0, 0, 1.0)), -sign * elbows)
    local[INDEX["Chest"]] = quat_from_axis_angle(np.array((1.0, 0, 0)), slouch)
    return forward_kinematics(offsets[0], local, offsets)[0]


def foreign_rig(
    names: Mapping[str, str],
    arms: float = 0.8,
    elbows: float = 0.4,
    seed: int = 5,
    unit: float = 1.0,
    tails: str = "child",
    extra: bool = True,
    slouch: float = 0.0,
) -> bpy.types.Object:
    """An armature whose bones are called ``names`` (joint -> bone; other joints have none), with random
    rolls, ``unit`` metres a unit of its bones; ``extra`` adds a root, twist bones and fingers.  ``tails`` is
    "child" or "up".
    """
    places = rest_places(own_offsets(), arms, elbows, slouch) / unit
    data = bpy.data.armatures.new("Rig")
    armature = bpy.data.objects.new("Rig", data)
    bpy.context.scene.collection.objects.link(armature)
    armature.scale = (unit,) * 3
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    rolls = np.random.default_rng(seed).uniform(-3, 3, J)
    top = None
    if extra:
        top = data.edit_bones.new("root")
        top.head, top.tail = (0, 0, 0), (0, 0.2 / unit, 0)
    for j, joint in enumerate(JOINTS):
        if joint not in names:
            continue
        bone = data.edit_bones.new(names[joint])
        bone.head = places[j]
        below = [k for k, p in enumerate(PARENTS) if p == j]
        end = places[j] + np.array(END_SITES.get(joint, (0, 0, 0.1))) / unit
        if tails == "child" and below and joint not in ("Hips", "Chest4"):
            end = places[below[0]]
        bone.tail = places[j] + np.array((0, 0, 0.1)) / unit if tails == "up" else end
        bone.roll = rolls[j]
        above = PARENTS[j]
        while above >= 0 and JOINTS[above] not in names:
            above = PARENTS[above]
        bone.parent = data.edit_bones[names[JOINTS[above]]] if above >= 0 else top
        if extra and joint.endswith(("Shoulder", "Hip", "Wrist")):
            for number in range(3 if joint.endswith("Wrist") else 1):
                aside = data.edit_bones.new(f"{names[joint]}_extra{number}")
                aside.head = places[j] + np.array((0, 0.01 * number, 0)) / unit
                aside.tail, aside.parent = aside.head + (bone.tail - bone.head) / 2, bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def add_deform_bones(rig: bpy.types.Object, deform: Mapping[str, str], switch: str) -> None:
    """Give a rig of controls bones that deform: control -> deform bone, each copying its control as far as
    the custom property ``switch`` of the bone root says, which is at 0.
    """
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for control, name in deform.items():
        bone, over = rig.data.edit_bones.new(name), rig.data.edit_bones[control]
        bone.head, bone.tail, bone.roll = over.head, over.tail, over.roll + 0.7
        bone.parent = rig.data.edit_bones["root"]
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.pose.bones["root"][switch] = 0.0
    for control, name in deform.items():
        constraint = rig.pose.bones[name].constraints.new("CHILD_OF")
        constraint.target, constraint.subtarget = rig, control
        constraint.inverse_matrix = rig.data.bones[control].matrix_local.inverted()
        curve = constraint.driver_add("influence")
        variable = curve.driver.variables.new()
        variable.type = "SINGLE_PROP"
        variable.targets[0].id, variable.targets[0].data_path = rig, f'pose.bones["root"]["{switch}"]'
        curve.driver.type = "AVERAGE"


def rigify_rig() -> tuple[bpy.types.Object, bpy.types.Object]:
    """A metarig of Rigify's and the rig that it generates from it."""
    bpy.ops.object.armature_basic_human_metarig_add()
    metarig = bpy.context.object
    bpy.ops.pose.rigify_generate()
    return metarig, next(o for o in bpy.data.objects if o.type == "ARMATURE" and o != metarig)
