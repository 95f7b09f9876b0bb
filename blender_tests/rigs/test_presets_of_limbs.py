"""IK controls in preset files: read, carried by the armature, saved, and refused with a sentence."""

from __future__ import annotations

import pytest
from foreign_rigs import MIXAMO, foreign_rig

import nsm_blender
from nsm_blender.rigs.bone_map import BoneMap, LimbControls, bone_map_of, store_map
from nsm_blender.rigs.presets import load_preset, save_preset
from nsm_core.errors import SkeletonError

CONTROLS = LimbControls("root", "Neck", "", ("Hips",), {"Head": {"IK_FK": 0.0, "ik_stretch": 0.0}})


def test_limbs_are_saved_and_loaded_as_they_were(tmp_path):
    save_preset(tmp_path / "own.toml", BoneMap(MIXAMO, limbs={"LeftWrist": CONTROLS}))
    rig = foreign_rig(MIXAMO)
    assert load_preset(tmp_path / "own.toml").on(rig.data.bones).limbs == {"LeftWrist": CONTROLS}
    assert not load_preset(tmp_path / "own.toml").on(set(MIXAMO.values())).limbs, "its control is missing"


def test_both_sides_are_told_at_once(tmp_path):
    path = tmp_path / "sided.toml"
    path.write_text(
        '[limb_sides.Ankle]\ncontrol = "foot.{side}"\n[limb_sides.Ankle.properties]\n"p.{side}" = { a = 1 }\n'
    )
    limbs = load_preset(path).limbs
    assert limbs["LeftAnkle"].control == "foot.L" and limbs["RightAnkle"].properties == {"p.R": {"a": 1}}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[limbs.LeftKnee]\ncontrol = "a"', "LeftKnee is not known"),
        ('[limbs.LeftWrist]\npole = "a"', "must name its control"),
        ('[limbs.LeftWrist]\ncontrol = "a"\npull = "b"', "pull"),
        (
            '[limbs.LeftWrist]\ncontrol = "a"\n[limbs.LeftWrist.properties]\nb = { c = "d" }',
            "must be a number",
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, told):
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(SkeletonError, match=told):
        load_preset(path)


def test_the_choice_is_the_armatures_and_counts_where_it_has_controls():
    nsm_blender.register()
    try:
        rig = foreign_rig(MIXAMO)
        rig.data.nsm_rig.limbs = "IK"
        assert not bone_map_of(rig).pulled
        store_map(rig.data, BoneMap(MIXAMO, limbs={"LeftWrist": CONTROLS}))
        assert bone_map_of(rig).pulled == {"LeftWrist": CONTROLS}
        assert bone_map_of(rig).switches == CONTROLS.properties
        rig.data.nsm_rig.limbs = "FK"
        assert not bone_map_of(rig).pulled and not bone_map_of(rig).switches
    finally:
        nsm_blender.unregister()
