"""Bad input: one plain sentence each, and nothing lost."""

from __future__ import annotations

import bpy
import pytest
from foreign_rigs import remove_bones
from scenes import box, empty, furnish

import nsm_blender
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import TakeSpec, finish, generate, prepare, shipped_model
from nsm_blender.ui.operators.generate import spec_of
from nsm_blender.ui.running import reason_not_ready
from nsm_core.errors import GeometryError, GoalError, NsmError, SkeletonError, WeightsError


@pytest.fixture
def settings():
    """The sidebar's settings with a character, a chair, a goal, and an action of the animator."""
    nsm_blender.register()
    bpy.ops.nsm.add_character()
    settings = bpy.context.scene.nsm
    chair, _ = furnish(position=(0.5, -2.0))
    settings.goals.add().object = chair
    hips = settings.character.pose.bones["Hips"]
    hips.keyframe_insert("location", frame=1)
    settings.character.animation_data.action.name = "Animator's"
    yield settings
    nsm_blender.unregister()


def refuse(settings, words: str) -> None:
    """Generate must fail with one sentence that holds ``words``, show it in the sidebar, and change
    nothing.
    """
    character = settings.character
    action, actions = character.animation_data.action, len(bpy.data.actions)
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.nsm.generate()
    sentence = str(caught.value)
    assert words in sentence, sentence
    assert "Traceback" not in sentence and sentence.strip().count("\n") == 0
    assert character.animation_data.action == action and len(bpy.data.actions) == actions
    assert any(words in line.text and not line.good for line in settings.results)


def test_bones_under_other_parents(settings):
    bpy.context.view_layer.objects.active = settings.character
    bpy.ops.object.mode_set(mode="EDIT")
    bones = settings.character.data.edit_bones
    bones["LeftKnee"].parent = bones["Hips"]
    bpy.ops.object.mode_set(mode="OBJECT")
    refuse(settings, "LeftKnee")


def test_a_bone_that_is_gone(settings):
    remove_bones(settings.character, "LeftKnee")
    with pytest.raises(RuntimeError, match="No bone of Character was found for LeftKnee"):
        bpy.ops.nsm.generate()
    with pytest.raises(SkeletonError, match="LeftKnee"):
        finish(prepare(TakeSpec(settings.character, [GoalSpec("idle")]), bpy.context.scene))


def test_armature_without_the_bones():
    other = bpy.data.objects.new("Other", bpy.data.armatures.new("Other"))
    bpy.context.scene.collection.objects.link(other)
    with pytest.raises(SkeletonError, match="No bone of Other was found for Hips, Head, .* and 12 more"):
        finish(prepare(TakeSpec(other, [GoalSpec("idle")]), bpy.context.scene))


def test_character_that_is_no_armature():
    with pytest.raises(SkeletonError, match="Crate is not an armature"):
        finish(prepare(TakeSpec(box("Crate", (0, 0, 0), (1, 1, 1)), [GoalSpec("idle")]), bpy.context.scene))


def test_character_removed_from_the_scene():
    character = add_character()
    bpy.context.scene.collection.objects.unlink(character)
    with pytest.raises(SkeletonError, match="no longer in the scene"):
        finish(prepare(TakeSpec(character, [GoalSpec("idle")]), bpy.context.scene))


def test_uneven_scale(settings):
    settings.character.scale = (1.0, 1.0, 1.4)
    refuse(settings, "apply its scale")


def test_goal_object_removed_from_the_scene(settings):
    bpy.context.scene.collection.objects.unlink(settings.goals[0].object)
    told = "Chair is no longer in this scene"
    assert not bpy.ops.nsm.generate.poll() and told in reason_not_ready(bpy.context)
    with pytest.raises(GoalError, match="Chair is no longer in the scene"):
        finish(prepare(spec_of(bpy.context.scene), bpy.context.scene))


def test_goal_object_deleted(settings):
    bpy.data.objects.remove(settings.goals[0].object)
    assert not bpy.ops.nsm.generate.poll() and "has no object; choose one" in reason_not_ready(bpy.context)
    with pytest.raises(GoalError, match="has no object; choose one"):
        finish(prepare(spec_of(bpy.context.scene), bpy.context.scene))


def test_goal_object_without_a_mesh(settings):
    settings.goals[0].object = empty("Marker", (1, 1, 0))
    refuse(settings, "Marker")


def test_goal_object_with_an_empty_mesh(settings):
    chair = settings.goals[0].object
    chair.modifiers.clear()
    chair.data.clear_geometry()
    refuse(settings, "Chair")


def test_goal_object_without_a_seat(settings):
    wall, _ = furnish("wall", "Wall", (3, 3))
    settings.goals[0].object = wall
    refuse(settings, "Wall")


def test_coordinates_that_are_not_numbers(settings):
    crate = box("Crate", (2, 2, 0), (3, 3, 1))
    crate.data.vertices[0].co.x = float("nan")
    bpy.context.view_layer.update()
    refuse(settings, "Crate")


def test_no_goals():
    with pytest.raises(GoalError, match="no goal"):
        finish(prepare(TakeSpec(add_character(), []), bpy.context.scene))


def test_goal_points_say_what_is_wrong_and_keep_the_rest(settings):
    wall, _ = furnish("wall", "Wall", (3, 3))
    settings.goals.add().object = wall
    settings.goals[1].action = "sit"
    assert bpy.ops.nsm.goal_points() == {"FINISHED"}
    # Where none is found there is one to move.
    assert {"NSM Goal Chair", "NSM Goal Wall"} <= set(bpy.data.objects.keys())


def test_missing_foreign_and_truncated_weights(tmp_path):
    with pytest.raises(WeightsError):
        shipped_model(str(tmp_path / "none.npz"))
    foreign = tmp_path / "foreign.npz"
    foreign.write_bytes(b"PK not weights")
    with pytest.raises(WeightsError):
        shipped_model(str(foreign))


def test_every_error_is_one_of_ours():
    assert all(issubclass(kind, NsmError) for kind in (SkeletonError, GoalError, GeometryError, WeightsError))


def test_a_goal_walled_in_on_all_sides_is_named_and_nothing_is_keyed():
    character = add_character()
    chair, _ = furnish(position=(0.0, -3.0))
    for name, low, high in (
        ("North", (-2.1, -1.1, 0), (2.1, -1.0, 2)),
        ("South", (-2.1, -5.0, 0), (2.1, -4.9, 2)),
        ("West", (-2.1, -5.0, 0), (-2.0, -1.0, 2)),
        ("East", (2.0, -5.0, 0), (2.1, -1.0, 2)),
    ):
        box(name, low, high)
    spec = TakeSpec(character, [GoalSpec("sit", chair, hold=0.5)])
    with pytest.raises(GoalError, match="Chair.* There is no free way"):
        finish(generate(spec, bpy.context.scene))
    assert not bpy.data.actions and character.pose.bones["Hips"].location.length == 0
