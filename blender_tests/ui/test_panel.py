"""The sidebar: why its buttons are off, and that everything it draws exists."""

from __future__ import annotations

import bpy
import pytest
from drawn import drawn, goals, reason
from foreign_rigs import remove_bones
from motions import wandering_take
from scenes import door, furnish

from nsm_blender.keys.keying import key_take
from nsm_blender.keys.report import goal_line, result_lines
from nsm_blender.ui import operators, running
from nsm_blender.ui.properties import queue_of, show_results
from nsm_blender.ui.reviews import remember
from nsm_core.world.actions import BY_KEY

pytestmark = pytest.mark.usefixtures("settings")


def test_generate_says_why_it_is_disabled(settings):
    assert "No character" in reason()
    assert not bpy.ops.nsm.generate.poll()
    bpy.ops.nsm.add_character()
    assert "no goal yet" in reason()
    furnish()
    bpy.data.objects["Chair"].select_set(True)
    bpy.ops.nsm.goal_add()
    assert reason() == "" and bpy.ops.nsm.generate.poll()
    goals()[0].enabled = False
    assert "No goal is enabled" in reason()
    goals()[0].enabled = True
    chair, goals()[0].object = goals()[0].object, None
    assert "A goal to sit has no object" in reason()
    goals()[0].object = chair
    goals()[0].action = "carry"
    assert "A goal to carry Chair has no destination" in reason()
    goals()[0].action = "sit"
    settings.character.data.bones["LeftKnee"].name = "Knie"
    assert reason() == "", "found by its place"
    remove_bones(settings.character, "Knie")
    assert "No bone of Character was found for LeftKnee;" in reason()
    bpy.context.scene.collection.objects.unlink(settings.character)
    assert "no longer in this scene" in reason()
    assert reason() in " ".join(drawn())


def test_reason_counts_the_missing_bones(settings):
    data = bpy.data.armatures.new("Bare")
    settings.character = bpy.data.objects.new("Bare", data)
    bpy.context.scene.collection.objects.link(settings.character)
    assert "found for Hips, Head, RightShoulder and 12 more" in reason()


def test_panel_draws_every_state(settings):
    assert "No character" in " ".join(drawn())
    bpy.ops.nsm.add_character()
    chair, _ = furnish()
    settings.goals.add().object = chair
    settings.goals.add().action = "walk"
    settings.goals.add().action = "idle"
    for action in ("run", "carry", "open", "climb"):
        settings.goals.add().action = action
    for index in range(len(settings.goals)):
        settings.active_goal = index
        drawn()
    show_results(
        settings, [("Chair: sat down after 4.1 s, 1.2 cm and 0.5° off.", True), ("Sofa: not reached.", False)]
    )
    seen = drawn()
    assert "Chair" in seen and "Generate" in seen and any("1.2\u00a0cm" in text for text in seen)
    running.begin_take(bpy.context.scene, settings.character)
    running.note_progress("Generating", 0.4)
    seen = drawn()
    assert any("40%" in text for text in seen) and any("ESC" in text for text in seen)


def test_takes_are_listed_with_what_can_be_done_with_them(settings):
    bpy.ops.nsm.add_character()
    assert "No take waits here; press Generate." in drawn() and "Another Take" not in drawn()
    hips, local = wandering_take(4)
    for seed in (3, 7):
        remember(bpy.context.scene, key_take(settings.character, hips, local, name="Sit"), seed, beside=True)
    shown = drawn()
    assert "Accept" in shown and "Another Take" in shown and "To NLA" in shown
    assert "3  1\u20134" in shown and "7  1\u20134" in shown
    bpy.ops.nsm.take_push()
    shown = drawn()
    assert "Accept" not in shown and "Back from NLA" in shown


def test_result_lines_tell_the_frames_and_where_the_scene_cuts_them_off():
    report = {"frames": 550, "goals": []}
    assert result_lines(report, 10, 600) == [("Keys on frames 10 to 559.", True)]
    assert "ends at 250" in result_lines(report, 1, 250)[0][0]


def test_result_lines_name_what_was_done():
    done = {
        "object": "X",
        "reached": True,
        "seconds": 4.0,
        "position_error_cm": 1.0,
        "rotation_error_deg": 1.0,
    }
    said = [goal_line({**done, "action": action})[3:].split(" after")[0] for action in BY_KEY]
    assert said == ["sat down", "arrived", "stands", "arrived", "set down", "opened", "climbed", "touched",
                    "put down"]  # fmt: skip


def test_time_left():
    assert running.time_left(0.5, 10.0) == ", 10 s left"
    assert running.time_left(0.01, 10.0) == running.time_left(1.0, 10.0) == running.time_left(0.5, 0.1) == ""


def test_while_a_take_runs_every_button_is_off_and_says_why(settings):
    bpy.ops.nsm.add_character()
    leaf, row = door((2.0, 2.0, 0.0)), settings.goals.add()
    row.object, row.action = leaf, "open"
    buttons = [getattr(bpy.ops.nsm, cls.bl_idname.removeprefix("nsm.")) for cls in operators.CLASSES]
    # No take, no keys, nothing that opens chosen, no place of its own, nobody else, and no window.
    off = {"fit_scene", "goal_to_cursor", "generate_all", "steer"}
    off |= {"fill", "another_fill", "decompress", "thin_out", "merge_strips", "what_opens"}
    off |= {
        name
        for button in buttons
        if (name := button.idname_py().removeprefix("nsm.")).startswith(
            ("take", "export", "variation_", "ghosts")
        )
    }
    assert {button.idname_py().removeprefix("nsm.") for button in buttons if not button.poll()} == off
    running.begin_take(bpy.context.scene, settings.character)
    for button in buttons:
        if button.idname_py() == "nsm.help":
            continue
        assert not button.poll()
        with pytest.raises(RuntimeError, match="A take is being generated; press ESC"):
            button()


def test_the_body_picks_its_armature(settings):
    bpy.ops.nsm.add_character()
    armature = settings.character
    body = next(o for o in armature.children_recursive if o.type == "MESH")
    settings.character = None
    settings.character = body
    assert settings.character == armature
    chair, _ = furnish()
    settings.character = chair
    assert "Chair is no armature, and none moves it" in reason() and not bpy.ops.nsm.generate.poll()


def test_the_scene_is_made_as_long_as_the_take(settings):
    scene = bpy.context.scene
    assert not bpy.ops.nsm.fit_scene.poll()
    bpy.ops.nsm.add_character()
    settings.character.keyframe_insert("location", frame=612)
    scene.frame_start, scene.use_preview_range, scene.frame_preview_end = 10, True, 100
    assert bpy.ops.nsm.fit_scene() == {"FINISHED"}
    assert (scene.frame_start, scene.frame_end, scene.frame_preview_end) == (10, 612, 612)
    assert not bpy.ops.nsm.fit_scene.poll()


@pytest.mark.parametrize("stocked", [False, True])
def test_every_button_that_is_off_says_why(settings, stocked):
    """In a sentence of its own, where Blender would only say that the context is wrong."""
    if stocked:
        bpy.ops.nsm.add_character()
        settings.character.keyframe_insert("location", frame=bpy.context.scene.frame_end)
        queue_of(bpy.context.scene).goals.add().object = furnish()[0]
    off = 0
    for cls in operators.CLASSES:
        button = getattr(bpy.ops.nsm, cls.bl_idname.removeprefix("nsm."))
        if not button.poll():
            off += 1
            with pytest.raises(RuntimeError) as raised:
                button()
            assert "context is incorrect" not in str(raised.value), cls.bl_idname
            assert str(raised.value).rstrip().endswith("."), cls.bl_idname
    assert off > 3
