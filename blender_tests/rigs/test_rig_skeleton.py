"""A performance on rigs of other proportions and rest poses, measured on the bones that Blender evaluates."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from foreign_rigs import MIXAMO, foreign_rig, own_offsets, rest_places
from motions import wandering_take
from test_bone_map import SMALL

from nsm_blender.keys.keying import key_take, read_back
from nsm_blender.rigs.armature import Placement
from nsm_core.body.skeleton import INDEX, OFFSETS, J, forward_kinematics
from nsm_core.rotations import quat_rotate

LIMBS = [
    (side + upper, side + lower)
    for side in ("Left", "Right")
    for upper, lower in (("Shoulder", "Elbow"), ("Elbow", "Wrist"), ("Hip", "Knee"), ("Knee", "Ankle"))
]


def keyed(rig: bpy.types.Object, names: dict[str, str], frames: int = 8):
    """Key a wandering take; heads (frames, joints of the rig) as evaluated, by joint, and the take."""
    scene = bpy.context.scene
    scene.render.fps = 30
    hips, local = wandering_take(frames)
    scale = Placement.of(rig).scale
    key_take(rig, hips * scale, local, 1, 30.0)
    heads = {joint: np.empty((frames, 3)) for joint in names}
    for frame in range(frames):
        scene.frame_set(1 + frame)
        for joint, bone in names.items():
            heads[joint][frame] = rig.matrix_world @ rig.pose.bones[bone].head
    return heads, hips * scale, local, scale


def worst_angle(heads: dict[str, np.ndarray], hips: np.ndarray, local: np.ndarray) -> float:
    """Largest angle, degrees, between a limb and ours."""
    world = forward_kinematics(hips, local)[1]
    worst = 0.0
    for upper, lower in LIMBS:
        theirs = heads[lower] - heads[upper]
        ours = quat_rotate(
            world[:, INDEX[upper]], np.tile(OFFSETS[INDEX[lower]], (len(hips), 1)).astype(float)
        )
        cosine = (theirs * ours).sum(1) / np.linalg.norm(theirs, axis=1) / np.linalg.norm(ours, axis=1)
        worst = max(worst, float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).max()))
    return worst


@pytest.mark.parametrize(
    ("names", "arms", "elbows", "unit", "tails"),
    [
        (MIXAMO, 0.8, 0.5, 1.0, "child"),  # A-pose, elbows bent
        (MIXAMO, 0.0, 0.0, 0.01, "up"),  # T-pose in centimetres, all bones point up
        (SMALL, 1.2, 0.2, 1.0, "child"),  # two spine bones, no neck, no collars, no toes
    ],
    ids=["A-pose", "centimetres", "small"],
)
def test_limbs_point_as_in_the_performance(names, arms, elbows, unit, tails):
    rig = foreign_rig(names, arms, elbows, unit=unit, tails=tails)
    heads, hips, local, scale = keyed(rig, names)
    assert worst_angle(heads, hips, local) < 0.1
    joints = forward_kinematics(hips, local, Placement.of(rig).keyed.offsets * scale)[0]
    for joint in names:
        if joint != "Hips":
            assert heads[joint] == pytest.approx(joints[:, INDEX[joint]], abs=1e-3 * scale)


def test_offsets_are_the_rigs_own_in_our_t_pose():
    rig = foreign_rig(MIXAMO, arms=0.8, elbows=0.5)
    placement = Placement.of(rig)
    offsets, own = placement.keyed.offsets * placement.scale, own_offsets()
    for name in ("LeftElbow", "RightWrist", "LeftKnee", "RightAnkle", "Head"):
        assert offsets[INDEX[name]] == pytest.approx(own[INDEX[name]], abs=1e-3), name
    hips = placement.keyed.offsets[[INDEX["LeftHip"], INDEX["RightHip"]]].mean(0)
    assert hips == pytest.approx((0, 0, -0.05), abs=1e-6), "over the hip joints as on our own skeleton"
    legs = (rest_places(own)[INDEX["LeftHip"], 2] - rest_places(own)[INDEX["LeftToe"], 2]) / 0.895
    assert placement.scale == pytest.approx(legs, rel=0.01)


def test_what_is_keyed_is_read_back():
    rig = foreign_rig(MIXAMO)
    heads, hips, local, _ = keyed(rig, MIXAMO)
    back, rotations = read_back(rig, range(1, 1 + len(hips)))
    assert back == pytest.approx(hips, abs=1e-3)
    for name in ("Hips", "LeftElbow", "RightKnee", "Head"):
        same = np.abs((rotations[:, INDEX[name]] * local[:, INDEX[name]]).sum(-1))
        assert same == pytest.approx(1, abs=1e-5), name


def test_feet_that_hang_on_the_root_follow_their_legs():
    rig = foreign_rig(MIXAMO)
    bpy.ops.object.mode_set(mode="EDIT")
    for side in ("Left", "Right"):
        rig.data.edit_bones[side + "Foot"].parent = rig.data.edit_bones["root"]
    bpy.ops.object.mode_set(mode="OBJECT")
    heads, hips, local, _ = keyed(rig, MIXAMO)
    assert worst_angle(heads, hips, local) < 0.1


def test_a_rig_that_stands_elsewhere_and_faces_another_way_is_keyed_in_the_world():
    rig = foreign_rig(MIXAMO)
    rig.location, rig.rotation_euler = (3.0, -1.0, 0.5), (0.0, 0.0, 2.0)
    heads, hips, local, _ = keyed(rig, MIXAMO)
    assert worst_angle(heads, hips, local) < 0.1
    middle = (heads["LeftHip"] + heads["RightHip"]) / 2
    assert np.linalg.norm(middle - hips, axis=1).max() < 0.06


def test_a_rig_that_slouches_at_rest_stands_upright_with_the_performance():
    rig = foreign_rig(MIXAMO, slouch=0.5)
    still = np.tile((1.0, 0.0, 0.0, 0.0), (2, J, 1))
    bpy.context.scene.render.fps = 30
    key_take(rig, np.tile((0.0, 0.0, 1.0), (2, 1)), still)
    bpy.context.scene.frame_set(1)
    bones = rig.pose.bones
    trunk = np.array(bones["Spine2"].head - (bones["LeftUpLeg"].head + bones["RightUpLeg"].head) / 2)
    assert np.degrees(np.arctan2(-trunk[1], trunk[2])) == pytest.approx(0, abs=6)
    arm = np.array(bones["LeftForeArm"].head - bones["LeftArm"].head)
    assert arm / np.linalg.norm(arm) == pytest.approx((1, 0, 0), abs=1e-3)
