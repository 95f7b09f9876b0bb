"""A rig of controls: they get the keys, with the switches that have the body obey them; what deforms is
looked at.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from foreign_rigs import MIXAMO, add_deform_bones, foreign_rig, rigify_rig
from motions import wandering_take
from test_rig_skeleton import worst_angle

import nsm_blender
from nsm_blender.animation.channels import curves_in
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import key_take, read_back
from nsm_blender.keys.preview import Preview, SceneState
from nsm_blender.keys.style import KeyStyle
from nsm_blender.keys.switches import switches_of
from nsm_blender.rigs.armature import Placement, read_world_pose
from nsm_blender.rigs.bone_map import BoneMap, bone_map_of, store_map
from nsm_core.body.key_reduction import Bound
from nsm_core.body.skeleton import INDEX, forward_kinematics

DEFORM = {joint: f"DEF-{bone}" for joint, bone in MIXAMO.items()}


@pytest.fixture
def rig():
    nsm_blender.register()
    made = foreign_rig(MIXAMO)
    add_deform_bones(made, {MIXAMO[joint]: bone for joint, bone in DEFORM.items()}, "FK")
    store_map(made.data, BoneMap(MIXAMO, DEFORM, {"root": {"FK": 1.0}}, family="controls"))
    bpy.context.scene.render.fps = 30
    yield made
    nsm_blender.unregister()


def switch(rig: bpy.types.Object) -> float:
    return rig.pose.bones["root"]["FK"]


def test_the_deform_bones_obey_and_a_rejected_take_gives_the_switch_back(rig):
    assert bone_map_of(rig).shown == DEFORM
    hips, local = wandering_take(6)
    take = key_take(rig, hips * Placement.of(rig).scale, local)
    heads = {}
    for frame in range(1, 7):
        bpy.context.scene.frame_set(frame)
        for joint, bone in DEFORM.items():
            heads.setdefault(joint, []).append(tuple(rig.matrix_world @ rig.pose.bones[bone].head))
    assert worst_angle({joint: np.array(each) for joint, each in heads.items()}, hips, local) < 0.1
    assert read_back(rig, range(1, 7))[0] == pytest.approx(hips * Placement.of(rig).scale, abs=1e-3)
    assert switch(rig) == 1
    discard_take(take)
    assert switch(rig) == 0


def test_a_preview_moves_the_deform_bones_and_leaves_no_trace(rig):
    hips, local = wandering_take(6)
    state = SceneState(bpy.context.scene, rig)
    before = rig.pose.bones["DEF-LeftHand"].head.copy()
    Preview(rig).show(hips[5], local[5])
    bpy.context.view_layer.update()
    assert switch(rig) == 1 and (rig.pose.bones["DEF-LeftHand"].head - before).length > 0.1
    state.restore(always=True)
    assert switch(rig) == 0 and (rig.pose.bones["DEF-LeftHand"].head - before).length < 1e-5


def test_a_take_that_fails_gives_the_switch_back(rig, monkeypatch):
    hips, local = wandering_take(6)

    def broken(*_):
        raise RuntimeError("out of order")

    monkeypatch.setattr("nsm_blender.keys.keying._touch", broken)
    with pytest.raises(RuntimeError, match="out of order"):
        key_take(rig, hips, local)
    bpy.context.scene.frame_set(3)
    assert switch(rig) == 0 and not bpy.data.actions


def test_a_metarig_and_the_rig_that_rigify_generates_from_it(rigify):
    metarig, generated = rigify_rig()
    bpy.context.scene.render.fps = 30
    hips, local = wandering_take(4)
    for made, family in ((metarig, "rigify"), (generated, "preset rigify_generated")):
        found = bone_map_of(made)
        assert found.family == family and found.score > 0.9 and not found.remarks
        key_take(made, hips * Placement.of(made).scale, local)
        heads = {joint: [] for joint in found.joints}
        for frame in range(1, 5):
            bpy.context.scene.frame_set(frame)
            for joint in found.joints:
                heads[joint].append(tuple(made.matrix_world @ made.pose.bones[found.seen(joint)].head))
        assert worst_angle({joint: np.array(each) for joint, each in heads.items()}, hips, local) < 0.1


def fewer_keys_of_controls_keep_hands_and_feet(rig):
    hips, local = wandering_take(40)
    placement = Placement.of(rig)
    ends = [INDEX[side + name] for side in ("Left", "Right") for name in ("Wrist", "Ankle")]
    shown = []
    for bound in (None, Bound(5.0, 1.0)):
        take = key_take(rig, hips * placement.scale, local, style=KeyStyle(reduce=bound))
        counts = {c.data_path: len(c.keyframe_points) for c in curves_in(take.action, take.slot)}
        places = []
        for frame in range(1, 41):
            bpy.context.scene.frame_set(frame)
            places.append(read_world_pose(rig, placement)[0][ends])
        shown.append(np.array(places))
        if bound is not None:
            of_hand = counts['pose.bones["hand_ik.L"].location']
            assert 4 < of_hand < 30 and counts['pose.bones["upper_arm_ik_target.R"].location'] < 30
            assert take.reduced.after < 0.7 * take.reduced.before and take.reduced.mm <= 5.0
        discard_take(take)
    # What the solver of a rig leaves of a millimetre comes on top.
    assert np.linalg.norm(shown[1] - shown[0], axis=-1).max() < 0.007


def test_hands_and_feet_of_a_generated_rig_are_placed_by_their_ik_controls(rigify):
    nsm_blender.register()
    try:
        _, rig = rigify_rig()
        bpy.context.scene.render.fps = 30
        rig.data.nsm_rig.limbs = "IK"
        before = switches_of(rig)
        hips, local = wandering_take(4)
        placement = Placement.of(rig)
        take = key_take(rig, hips * placement.scale, local)
        keyed = {curve.data_path.split('"')[1] for curve in curves_in(take.action, take.slot)}
        assert {"hand_ik.L", "upper_arm_ik_target.R", "foot_ik.R", "thigh_ik_target.L"} <= keyed
        assert not {"thigh_fk.L", "foot_fk.L", "hand_fk.R"} & keyed
        meant = forward_kinematics(hips, local, placement.own_offsets.astype(float))[0] * placement.scale
        for frame in range(1, 5):
            bpy.context.scene.frame_set(frame)
            off = np.linalg.norm(read_world_pose(rig, placement)[0] - meant[frame - 1], axis=1)
            ends = [INDEX[side + name] for side in ("Left", "Right") for name in ("Wrist", "Ankle")]
            assert off[ends].max() < 0.003 and off.max() < 0.03  # knees here bend any way
        discard_take(take)
        assert switches_of(rig) == before
        fewer_keys_of_controls_keep_hands_and_feet(rig)
    finally:
        nsm_blender.unregister()
