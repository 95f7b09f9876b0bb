"""The list of goals in the sidebar: its rows, their points, and what is done with them."""

from __future__ import annotations

import bpy
import pytest
from drawn import drawn, goals, reason
from modal import Modal, Window
from scenes import door, empty, furnish

from nsm_blender.ui import running
from nsm_blender.ui.operators.generate import spec_of
from nsm_blender.ui.operators.goal_list import NSM_OT_goal_points
from nsm_core.errors import GoalError
from nsm_core.world.actions import BY_KEY


def test_selected_objects_become_goals_once(settings):
    bpy.ops.nsm.add_character()
    furnish("chair", "Chair")
    furnish("sofa", "Sofa", (2, 0))
    for name in ("Chair", "Sofa", "Character", "Mannequin"):
        if name in bpy.data.objects:
            bpy.data.objects[name].select_set(True)
    bpy.ops.nsm.goal_add()
    assert sorted((g.object.name, g.action) for g in goals()) == [("Chair", "sit"), ("Sofa", "sit")]
    bpy.ops.nsm.goal_add()
    assert len(goals()) == 3 and goals()[2].object is None and goals()[2].action == "walk"


def test_list_moves_and_removes(settings):
    for name in "ABC":
        settings.goals.add().object = empty(name, (0, 0, 0))
    settings.active_goal = 0
    assert bpy.ops.nsm.goal_move(direction="UP") == {"CANCELLED"}
    bpy.ops.nsm.goal_move(direction="DOWN")
    assert [g.object.name for g in settings.goals] == ["B", "A", "C"] and settings.active_goal == 1
    bpy.ops.nsm.goal_remove()
    assert [g.object.name for g in settings.goals] == ["B", "C"]
    settings.active_goal = 1
    bpy.ops.nsm.goal_remove()
    assert settings.active_goal == 0
    bpy.ops.nsm.goal_remove()
    assert not bpy.ops.nsm.goal_remove.poll()


def test_disabled_goals_are_left_out_of_the_take(settings):
    for name, enabled in (("A", True), ("B", False)):
        row = settings.goals.add()
        row.object, row.enabled, row.action, row.hold = empty(name, (0, 0, 0)), enabled, "walk", 3.5
    settings.seed, settings.start_frame = 5, 40
    spec = spec_of(bpy.context.scene)
    assert [(g.object.name, g.action, g.hold) for g in spec.goals] == [("A", "walk", 3.5)]
    assert (spec.seed, spec.start_frame) == (5, 40)


def test_only_armatures_and_things_with_a_place_are_offered(settings):
    light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    pointers = settings.bl_rna.properties["character"], settings.goals.add().bl_rna.properties["object"]
    assert all(p.type == "POINTER" for p in pointers)
    from nsm_blender.ui.properties import _acts, _is_goal

    assert not _acts(settings, light) and not _is_goal(settings, light)
    assert _is_goal(settings, empty("Mark", (0, 0, 0)))


def test_a_carry_row_shows_where_it_goes(settings):
    row = settings.goals.add()
    row.object, row.action = empty("Box", (0, 0, 0)), "carry"
    assert "No destination" in drawn() and "To" in drawn()
    row.destination = empty("Table", (1, 0, 0))
    assert "to Table" in drawn() and "No destination" not in drawn()
    assert spec_of(bpy.context.scene).goals[0].to == row.destination
    row.action = "sit"
    assert "to Table" not in drawn() and spec_of(bpy.context.scene).goals[0].to is None


def test_a_door_row_can_be_turned_to_the_other_side(settings):
    assert not bpy.ops.nsm.door_swing.poll()
    bpy.ops.nsm.add_character()
    leaf, row = door((2.0, 2.0, 0.0)), settings.goals.add()
    row.object, row.action = leaf, "open"
    assert "Swing to the Other Side" in drawn()
    assert bpy.ops.nsm.door_swing() == {"FINISHED"}
    assert bpy.data.objects["NSM Hinge Door"]["nsm_swing"] == -1
    bpy.ops.nsm.door_swing()
    assert bpy.data.objects["NSM Hinge Door"]["nsm_swing"] == 1
    assert bpy.ops.nsm.goal_points() == {"FINISHED"} and "NSM Handle Door" in bpy.data.objects


def test_goal_points_operator_makes_empties(settings):
    bpy.ops.nsm.add_character()
    chair, _ = furnish(position=(2, 0))
    goals().add().object = chair
    assert bpy.ops.nsm.goal_points() == {"FINISHED"}
    point = bpy.data.objects["NSM Goal Chair"]
    assert point.parent == chair
    assert bpy.context.selected_objects == [point] and bpy.context.view_layer.objects.active == point
    bpy.ops.nsm.goal_add()  # a goal point is no goal of its own
    assert [goal.object for goal in goals()] == [chair, None]


@pytest.mark.parametrize("broken_off", [False, True])
def test_goal_points_are_found_between_redraws(settings, broken_off):
    bpy.ops.nsm.add_character()
    chair, _ = furnish(position=(2, 0))
    settings.goals.add().object = chair
    modal = Modal(Window(), NSM_OT_goal_points)
    assert modal._start(modal.window) == {"RUNNING_MODAL"} and running.current() is not None
    assert not bpy.ops.nsm.goal_points.poll() and "NSM Goal Chair" not in bpy.data.objects
    if broken_off:
        assert modal.event("TIMER") == {"RUNNING_MODAL"} and modal.event("ESC") == {"CANCELLED"}
        assert (
            "Show Goal Points was cancelled" in modal.reports[-1][1]
            and "NSM Goal Chair" not in bpy.data.objects
        )
    else:
        ended = next(r for _ in range(10_000) if (r := modal.event("TIMER")) != {"RUNNING_MODAL"})
        assert ended == {"FINISHED"} and bpy.context.selected_objects == [bpy.data.objects["NSM Goal Chair"]]
    assert running.current() is None and modal.window.timers == 0


def test_what_goal_points_stand_on_is_watched(settings):
    bpy.ops.nsm.add_character()
    chair, _ = furnish(position=(2, 0))
    settings.goals.add().object = chair
    modal = Modal(Window(), NSM_OT_goal_points)
    modal._start(modal.window)
    bpy.data.objects.remove(chair)
    assert modal.event("TIMER") == {"CANCELLED"}
    assert (
        "Chair, a goal of the take, was deleted meanwhile, so Show Goal Points stopped and no point was made"
        in modal.reports[-1][1]
    )


def store(row, number: int) -> None:
    """Give a row an action number that only another version knows, as a file may hold it."""
    stored = row.bl_system_properties_get(do_create=True) if hasattr(row, "bl_system_properties_get") else row
    stored["action"] = number


@pytest.mark.parametrize("number", [99, -1, len(BY_KEY)])
@pytest.mark.filterwarnings("ignore:.*matches no enum.*:RuntimeWarning")
def test_an_unknown_action_is_told_with_its_row(settings, number):
    bpy.ops.nsm.add_character()
    chair, _ = furnish()
    settings.goals.add().object = chair
    settings.goals.add().object = chair
    store(settings.goals[1], number)
    settings.active_goal = 1
    sentence = "Goal 2, Chair, has an action that this version of the add-on does not know"
    assert "Unknown action" in drawn() and sentence in reason() and not bpy.ops.nsm.generate.poll()
    assert not bpy.ops.nsm.door_swing.poll()
    with pytest.raises(GoalError, match=sentence):
        spec_of(bpy.context.scene)
    with pytest.raises(RuntimeError, match=sentence):
        bpy.ops.nsm.goal_points()
    settings.goals[1].enabled = False  # a row that is not asked for does no harm
    assert reason() == "" and len(spec_of(bpy.context.scene).goals) == 1
    settings.goals[1].enabled, settings.goals[1].action = True, "walk"
    assert reason() == "" and "Unknown action" not in drawn()


@pytest.mark.parametrize(("fps", "base"), [(24, 1.0), (24, 1.001), (60, 1.0)])
def test_a_stay_is_told_in_frames_of_the_scene(settings, fps, base):
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = fps, base
    row = settings.goals.add()
    assert row.hold_frames == round(2.0 * fps / base)
    row.hold_frames = 90
    assert row.hold == pytest.approx(90 * base / fps) and row.hold_frames == 90


def test_a_place_is_taken_from_the_cursor(settings):
    assert not bpy.ops.nsm.goal_to_cursor.poll()
    row = settings.goals.add()
    row.action = "walk"
    bpy.context.scene.cursor.location = (1.0, 2.0, 0.5)
    assert bpy.ops.nsm.goal_to_cursor() == {"FINISHED"} and tuple(row.location) == (1.0, 2.0, 0.5)
    row.object = empty("Mark", (0, 0, 0))
    assert not bpy.ops.nsm.goal_to_cursor.poll(), "the object is the place"
