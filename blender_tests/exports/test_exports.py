"""A take that is exported is the take: every joint, and what was moved, where the scene shows them."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from foreign_rigs import MIXAMO, foreign_rig
from motions import imported_bvh
from scenes import box

import nsm_blender
from nsm_blender.exports.glb import glb_is_whole
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.rigs.armature import Placement, read_world_pose
from nsm_blender.takes import TakeSpec, finish, generate
from nsm_core.body.skeleton import JOINTS

FIRST, RATE = -20, 25
MILLIMETRE = 1e-3


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory) -> Path:
    """A rig with bones and proportions of its own, away from the origin and turned, carries a box onto
    another one; something else moves, too.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = RATE
    rig = foreign_rig(MIXAMO, extra=False)
    rig.location, rig.rotation_euler.z = (2.0, 1.0, 0.0), 0.6
    crate = box("Crate", (1.8, -0.5, 0.0), (2.1, -0.2, 0.3))
    top = box("Top", (0.2, -0.6, 0.0), (1.0, 0.2, 0.5))
    other = box("Other", (5, 5, 0), (6, 6, 1))
    other.keyframe_insert("location", frame=1)
    spec = TakeSpec(rig, [GoalSpec("carry", crate, 0.3, to=top)], name="Carry it", start_frame=FIRST)
    take = finish(generate(spec, bpy.context.scene))
    assert take.report["goals"][0]["reached"]
    path = tmp_path_factory.mktemp("exports") / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def scene(scene_file) -> bpy.types.Scene:
    """The scene with its take, the add-on switched on and the rig chosen."""
    nsm_blender.register()
    bpy.ops.wm.open_mainfile(filepath=str(scene_file))
    bpy.context.scene.nsm.character = bpy.data.objects["Rig"]
    bpy.context.scene.frame_set(5)
    yield bpy.context.scene
    nsm_blender.unregister()


def last_of(rig: bpy.types.Object) -> int:
    return int(rig.animation_data.action.frame_range[1])


def heads_of(rig: bpy.types.Object, frame: int) -> np.ndarray:
    bpy.context.scene.frame_set(frame)
    return np.array([rig.matrix_world @ rig.pose.bones[bone].head for bone in MIXAMO.values()])


def state(scene: bpy.types.Scene) -> list:
    """What an export may not change."""
    return [
        scene.frame_current,
        sorted(o.name for o in bpy.data.objects),
        sorted(c.name for c in bpy.data.collections),
        sorted(a.name for a in bpy.data.actions),
        [(o.name, o.select_get()) for o in scene.objects],
    ]


def test_a_glb_has_the_character_and_what_it_moved_and_nothing_else(scene, tmp_path):
    rig, crate = bpy.data.objects["Rig"], bpy.data.objects["Crate"]
    scene.nsm.character.nsm_queue.goals.add().object = crate
    rig.hide_set(True)
    frames = range(FIRST, last_of(rig) + 1, 7)
    expected = [(heads_of(rig, frame), np.array(crate.matrix_world)) for frame in frames]
    scene.frame_set(5)
    before = state(scene)
    assert bpy.ops.nsm.export_glb(filepath=str(tmp_path / "take.glb")) == {"FINISHED"}
    assert state(scene) == before and glb_is_whole(tmp_path / "take.glb")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = RATE
    bpy.ops.import_scene.gltf(filepath=str(tmp_path / "take.glb"))
    assert {"Rig", "Crate"} <= set(bpy.data.objects.keys()) and not {"Top", "Other"} & set(
        bpy.data.objects.keys()
    )
    assert [action.name for action in bpy.data.actions] == ["Carry it"]
    rig, crate = bpy.data.objects["Rig"], bpy.data.objects["Crate"]
    for frame, (heads, placed) in zip(frames, expected, strict=True):
        np.testing.assert_allclose(heads_of(rig, frame - FIRST), heads, atol=MILLIMETRE)
        np.testing.assert_allclose(np.array(crate.matrix_world), placed, atol=MILLIMETRE)


def test_a_bvh_has_the_joints_where_the_scene_shows_them(scene, tmp_path):
    rig = bpy.data.objects["Rig"]
    placement, expected = Placement.of(rig), []
    frames = range(FIRST, last_of(rig) + 1, 7)
    for frame in frames:
        scene.frame_set(frame)
        expected.append(read_world_pose(rig, placement)[0])
    scene.frame_set(5)
    before = state(scene)
    assert bpy.ops.nsm.export_bvh(filepath=str(tmp_path / "take")) == {"FINISHED"}
    assert state(scene) == before
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = RATE
    read = imported_bvh(tmp_path / "take.bvh")
    for frame, joints in zip(frames, expected, strict=True):
        bpy.context.scene.frame_set(frame - FIRST + 1)  # the importer begins at one
        heads = [read.matrix_world @ read.pose.bones[name].head for name in JOINTS]
        np.testing.assert_allclose(heads, joints, atol=MILLIMETRE)


@pytest.mark.parametrize("kind", ["bvh", "glb"])
def test_what_cannot_be_exported_is_told_in_a_sentence(scene, tmp_path, kind):
    export = getattr(bpy.ops.nsm, f"export_{kind}")
    (tmp_path / "file").write_text("")
    with pytest.raises(RuntimeError, match="cannot be written") as caught:
        export(filepath=str(tmp_path / "file" / f"take.{kind}"))
    assert "Traceback" not in str(caught.value)
    bpy.data.objects["Rig"].animation_data.action = None
    with pytest.raises(RuntimeError, match="The character has no action; generate a take first"):
        export(filepath=str(tmp_path / f"take.{kind}"))
    assert not (tmp_path / f"take.{kind}").exists()


def test_a_glb_that_was_cut_short_is_none(tmp_path):
    path = tmp_path / "a.glb"
    path.write_bytes(b"glTF" + (2).to_bytes(4, "little") + (40).to_bytes(4, "little") + bytes(28))
    assert glb_is_whole(path)
    path.write_bytes(path.read_bytes()[:-1])
    assert not glb_is_whole(path) and not glb_is_whole(tmp_path)
