"""The list of bones in the sidebar: what it shows, and what its buttons do and say."""

from __future__ import annotations

import types

import bpy
import pytest
from drawn import Layout
from foreign_rigs import MIXAMO, foreign_rig, remove_bones

import nsm_blender
from nsm_blender.ui.bones_panel import NSM_PT_bones
from nsm_blender.ui.running import reason_not_ready
from nsm_core.body.skeleton import JOINTS


@pytest.fixture(autouse=True)
def rig():
    nsm_blender.register()
    made = bpy.context.scene.nsm.character = foreign_rig(MIXAMO)
    yield made
    nsm_blender.unregister()


def drawn() -> list[str]:
    layout = Layout()
    NSM_PT_bones.draw(types.SimpleNamespace(layout=layout), bpy.context)
    return layout.seen


def test_it_is_there_for_armatures_only(rig):
    assert NSM_PT_bones.poll(bpy.context)
    bpy.context.scene.nsm.character = None
    assert not NSM_PT_bones.poll(bpy.context)
    assert not bpy.ops.nsm.bones_detect.poll()


def test_every_bone_has_a_field_once_they_are_detected(rig):
    assert "Press Detect" in " ".join(drawn()) and "LeftForeArm" not in drawn()
    assert bpy.ops.nsm.bones_detect() == {"FINISHED"}
    seen = drawn()
    assert set(MIXAMO.values()) <= set(seen)
    assert "22 of 23 bones." in " ".join(seen) and "mixamo motionbuilder" in " ".join(seen)
    assert len(rig.data.nsm_rig.joints) == len(JOINTS)


def test_a_bone_that_is_missing_is_told_there_and_at_generate(rig):
    bpy.ops.nsm.bones_detect()
    remove_bones(rig, "LeftForeArm")
    told = " ".join(drawn()).replace("\u00a0", " ")
    assert "no bone LeftForeArm" in told and "press Detect" in told
    assert "no bone LeftForeArm" in reason_not_ready(bpy.context)


def test_what_is_odd_is_told_as_soon_as_it_is_chosen(rig):
    bpy.ops.nsm.bones_detect()
    rows = {row.name: row for row in rig.data.nsm_rig.joints}
    rows["LeftKnee"].bone, rows["RightKnee"].bone = "RightLeg", "LeftLeg"
    assert "sides of Knee are exchanged" in " ".join(drawn())


def test_a_list_that_is_cleared_is_found_anew(rig):
    bpy.ops.nsm.bones_detect()
    rig.data.nsm_rig.joints[0].bone = ""
    assert "No bone of Rig was found for Hips" in reason_not_ready(bpy.context)
    bpy.ops.nsm.bones_clear()
    assert reason_not_ready(bpy.context).startswith("There is no goal yet")


def test_a_file_that_cannot_be_read_or_written_is_told_in_a_sentence(rig, tmp_path):
    with pytest.raises(RuntimeError, match=r"none.toml cannot be read"):
        bpy.ops.nsm.bones_load(filepath=str(tmp_path / "none.toml"))
    (tmp_path / "file").write_text("")
    with pytest.raises(RuntimeError, match="The bone map"):
        bpy.ops.nsm.bones_save(filepath=str(tmp_path / "file" / "mine.toml"))


def test_the_list_survives_saving_and_opening(rig, tmp_path):
    bpy.ops.nsm.bones_detect()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    joints = bpy.data.objects["Rig"].data.nsm_rig.joints
    assert {row.name: row.bone for row in joints if row.bone} == MIXAMO
