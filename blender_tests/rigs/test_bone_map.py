"""Which bones stand for the 23 joints: found, judged, kept, saved and loaded."""

from __future__ import annotations

import bpy
import pytest
from foreign_rigs import MIXAMO, foreign_rig

import nsm_blender
from nsm_blender.rigs.armature import build_armature, require_skeleton
from nsm_blender.rigs.bone_map import BoneMap, bone_map_of, found_map, store_map, stored_map
from nsm_blender.rigs.detect import judged_on, spread
from nsm_blender.rigs.presets import load_preset, save_preset
from nsm_core.body.skeleton import JOINTS
from nsm_core.errors import SkeletonError

SIDES = (("Left", "L"), ("Right", "R"))


def sided(pattern: str, trunk: dict[str, str], limbs: dict[str, str]) -> dict[str, str]:
    """Names of a whole body: ``pattern`` puts a limb's name and its side together."""
    return trunk | {
        side + ours: pattern.format(name=theirs, side=letter, small=letter.lower())
        for side, letter in SIDES
        for ours, theirs in limbs.items()
    }


UNREAL = sided(
    "{name}_{small}",
    {"Hips": "pelvis", "Chest": "spine_01", "Chest3": "spine_02", "Chest4": "spine_03", "Neck": "neck_01",
     "Head": "head"},
    {"Collar": "clavicle", "Shoulder": "upperarm", "Elbow": "lowerarm", "Wrist": "hand", "Hip": "thigh",
     "Knee": "calf", "Ankle": "foot", "Toe": "ball"},
)  # fmt: skip
VRM = sided(
    "J_Bip_{side}_{name}",
    {"Hips": "J_Bip_C_Hips", "Chest": "J_Bip_C_Spine", "Chest3": "J_Bip_C_Chest",
     "Chest4": "J_Bip_C_UpperChest", "Neck": "J_Bip_C_Neck", "Head": "J_Bip_C_Head"},
    {"Collar": "Shoulder", "Shoulder": "UpperArm", "Elbow": "LowerArm", "Wrist": "Hand", "Hip": "UpperLeg",
     "Knee": "LowerLeg", "Ankle": "Foot", "Toe": "ToeBase"},
)  # fmt: skip
SMALL = sided(  # two spine bones, no neck, no collars, no toes
    "{name}.{small}",
    {"Hips": "hips", "Chest2": "spine", "Chest4": "chest", "Head": "head"},
    {"Shoulder": "upperarm", "Elbow": "lowerarm", "Wrist": "hand", "Hip": "upperleg", "Knee": "lowerleg",
     "Ankle": "foot"},
)  # fmt: skip


@pytest.mark.parametrize(
    "names",
    [MIXAMO, {k: f"mixamorig:{v}" for k, v in MIXAMO.items()}, UNREAL, VRM, SMALL],
    ids=["mixamo", "prefixed", "unreal", "vrm", "small"],
)
def test_families_are_found_by_their_names(names):
    rig = foreign_rig(names)
    found = bone_map_of(rig)
    assert dict(found.joints) == names
    assert found.score > 0.85 and not found.remarks
    require_skeleton(rig)


def test_hips_are_the_bone_over_legs_and_spine_where_a_pelvis_carries_legs_alone():
    names = sided(
        "CC_Base_{side}_{name}",
        {"Hips": "CC_Base_Hip", "Chest": "CC_Base_Waist", "Chest3": "CC_Base_Spine01",
         "Chest4": "CC_Base_Spine02", "Neck": "CC_Base_NeckTwist01", "Head": "CC_Base_Head"},
        {"Collar": "Clavicle", "Shoulder": "Upperarm", "Elbow": "Forearm", "Wrist": "Hand", "Hip": "Thigh",
         "Knee": "Calf", "Ankle": "Foot", "Toe": "ToeBase"},
    )  # fmt: skip
    rig = foreign_rig(names)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    pelvis = bones.new("CC_Base_Pelvis")
    pelvis.head, pelvis.tail, pelvis.parent = (0, 0, 0.97), (0, 0, 0.9), bones["CC_Base_Hip"]
    for side in "LR":
        bones[f"CC_Base_{side}_Thigh"].parent = pelvis
    bpy.ops.object.mode_set(mode="OBJECT")
    assert dict(bone_map_of(rig).joints) == names
    require_skeleton(rig)


def test_our_own_names_go_before_all():
    found = bone_map_of(build_armature("Character"))
    assert dict(found.joints) == {name: name for name in JOINTS} and found.score == 1


def test_a_body_without_names_is_found_by_its_shape():
    names = {joint: f"Bone.{number:03d}" for number, joint in enumerate(JOINTS)}
    rig = foreign_rig(names)
    found = bone_map_of(rig)
    assert dict(found.joints) == names and found.family == "its shape"


def test_a_generated_rigify_rig_is_keyed_on_its_controls_by_a_file_alone():
    names = {
        "Hips": "torso",
        "Chest2": "spine_fk.002",
        "Chest4": "spine_fk.003",
        "Neck": "neck",
        "Head": "head",
    }
    limbs = {"Collar": "shoulder", "Shoulder": "upper_arm_fk", "Elbow": "forearm_fk", "Wrist": "hand_fk",
             "Hip": "thigh_fk", "Knee": "shin_fk", "Ankle": "foot_fk", "Toe": "toe_fk"}  # fmt: skip
    names = sided("{name}.{side}", names, limbs)
    found = bone_map_of(foreign_rig(names))
    assert dict(found.joints) == names and found.family == "preset rigify_generated"


def test_the_spine_is_spread_with_its_last_bone_under_the_arms():
    assert spread(("a",)) == {"Chest4": "a"}
    assert spread(("a", "b", "c")) == {"Chest": "a", "Chest3": "b", "Chest4": "c"}
    five = spread(("a", "b", "c", "d", "e"))
    assert list(five) == ["Chest", "Chest2", "Chest3", "Chest4"] and five["Chest4"] == "e"


def test_exchanged_sides_lower_the_score_and_are_told():
    rig = foreign_rig(MIXAMO)
    other = {"Left": "Right", "Right": "Left"}
    wrong = {
        next((other[s] + joint.removeprefix(s) for s in other if joint.startswith(s)), joint): bone
        for joint, bone in MIXAMO.items()
    }
    found, exchanged = found_map(rig.data), judged_on(rig.data, BoneMap(wrong))
    assert exchanged.score < 0.95 * found.score
    assert any("exchanged" in remark for remark in exchanged.remarks)


def test_a_body_with_its_names_exchanged_or_its_back_to_us_has_its_left_on_its_left():
    rig = foreign_rig({joint: f"Bone.{number:03d}" for number, joint in enumerate(JOINTS)})
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in rig.data.edit_bones:  # half a turn about the vertical
        ends = [(-end[0], -end[1], end[2]) for end in (bone.head, bone.tail)]
        bone.head, bone.tail = ends
    bpy.ops.object.mode_set(mode="OBJECT")
    found = found_map(rig.data)
    assert found.joints["LeftElbow"] == f"Bone.{JOINTS.index('LeftElbow'):03d}" and not found.remarks


def test_what_is_missing_is_named_with_what_to_do():
    rig = foreign_rig({k: v for k, v in MIXAMO.items() if not k.endswith(("Elbow", "Wrist"))}, extra=False)
    with pytest.raises(
        SkeletonError,
        match=r"No bone of Rig was found for RightElbow, RightWrist, LeftElbow and 1 more.*under Bones",
    ):
        require_skeleton(rig)


def test_a_list_rules_over_what_is_found_and_names_lost_bones(registered):
    rig = foreign_rig(MIXAMO)
    store_map(rig.data, found_map(rig.data))
    before = rig.data.nsm_rig.score
    row = next(row for row in rig.data.nsm_rig.joints if row.name == "LeftElbow")
    row.bone = "LeftHand"
    assert bone_map_of(rig).joints["LeftElbow"] == "LeftHand" and rig.data.nsm_rig.score < before
    with pytest.raises(SkeletonError, match="LeftHand of Rig stands for two joints"):
        require_skeleton(rig)
    row.bone = "LeftForeArm"
    require_skeleton(rig)
    rig.data.bones["LeftForeArm"].name = "other"
    with pytest.raises(SkeletonError, match="no bone LeftForeArm.*press Detect"):
        require_skeleton(rig)


def test_a_list_is_saved_and_loaded_as_a_file(registered, tmp_path):
    rig = foreign_rig({k: f'odd "{v}" \\ é' for k, v in MIXAMO.items()})
    bpy.context.scene.nsm.character = rig
    bpy.ops.nsm.bones_detect()
    kept = stored_map(rig.data)
    bpy.ops.nsm.bones_save(filepath=str(tmp_path / "mine.toml"))
    bpy.ops.nsm.bones_clear()
    assert stored_map(rig.data) is None
    bpy.ops.nsm.bones_load(filepath=str(tmp_path / "mine.toml"))
    assert dict(stored_map(rig.data).joints) == dict(kept.joints)
    assert rig.data.nsm_rig.score == pytest.approx(kept.score, abs=0.05)


def test_a_list_in_the_users_folder_is_tried_on_every_character(registered, tmp_path, monkeypatch):
    monkeypatch.setattr("nsm_blender.rigs.presets.user_folder", lambda: tmp_path)
    names = {joint: f"b{number}" for number, joint in enumerate(MIXAMO)}
    rig = foreign_rig(names)
    assert found_map(rig.data).family == "its shape"
    save_preset(tmp_path / "studio.toml", BoneMap(names))
    found = found_map(rig.data)
    assert dict(found.joints) == names and found.family == "preset studio"
    (tmp_path / "studio.toml").write_text("no preset at all")
    assert found_map(rig.data).family == "its shape"


def test_controls_and_switches_survive_a_file(tmp_path):
    preset = load_preset(nsm_blender.__path__[0] + "/rigs/presets/rigify_generated.toml")
    bones = {names[0] for names in (*preset.joints.values(), *preset.shown.values())} | set(preset.properties)
    chosen = preset.on(bones)
    save_preset(tmp_path / "again.toml", chosen)
    again = load_preset(tmp_path / "again.toml").on(bones)
    assert (again.joints, again.shown, again.properties) == (chosen.joints, chosen.shown, chosen.properties)
    assert chosen.properties["thigh_parent.L"]["IK_FK"] == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[bones]\nHips = 1\n", "bones.* is not known in a bone map"),
        ("[joints]\nHips = 3\n", "Hips must name"),
        ("[joints]\nTail = 'x'\n", "Tail is not one of the 23 joints"),
        ("[properties]\nx = { y = 'z' }\n", "y of x must be a number"),
        ("joints = ", "TOML|toml"),
    ],
)
def test_wrong_files_are_refused_in_a_sentence(tmp_path, text, told):
    path = tmp_path / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SkeletonError, match=told):
        load_preset(path)
