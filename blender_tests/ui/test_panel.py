"""The sidebar: its list, why Generate is disabled, and that everything it draws exists."""

from __future__ import annotations

import types

import bpy
import pytest
from foreign_rigs import remove_bones
from modal import Modal, Window
from motions import wandering_take
from scenes import door, empty, furnish

import nsm_blender
from nsm_blender.keys.keying import key_take
from nsm_blender.keys.report import goal_line, result_lines
from nsm_blender.ui import operators, panels, running
from nsm_blender.ui.bones_panel import NSM_PT_bones
from nsm_blender.ui.operators.generate import spec_of
from nsm_blender.ui.operators.goal_list import NSM_OT_goal_points
from nsm_blender.ui.properties import queue_of, show_results
from nsm_blender.ui.reviews import remember
from nsm_core.errors import GoalError
from nsm_core.world.actions import BY_KEY

ICONS = set(bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys())


@pytest.fixture(autouse=True)
def settings():
    nsm_blender.register()
    yield bpy.context.scene.nsm
    running.end_take()
    nsm_blender.unregister()


class Layout:
    """Takes the place of UILayout, which only a window has: notes texts, and checks that what is drawn
    exists.
    """

    def __init__(self, seen: list[str] | None = None) -> None:
        self.__dict__["seen"] = [] if seen is None else seen

    def _part(self, **_):
        return Layout(self.seen)

    row = column = box = split = _part

    def prop_search(self, data, name, found_in, among, **_):
        assert name in data.bl_rna.properties and among in found_in.bl_rna.properties
        self.seen.append(getattr(data, name))

    def separator(self, **_):
        pass

    def label(self, text="", icon="NONE"):
        assert icon in ICONS, icon
        self.seen.append(text)

    def prop(self, data, name, text=None, **_):
        assert name in data.bl_rna.properties, name
        self.seen.append(text if text is not None else data.bl_rna.properties[name].name)

    def operator(self, idname, text=None, icon="NONE", **_):
        assert icon in ICONS, icon
        kind = getattr(bpy.ops.nsm, idname.removeprefix("nsm.")).get_rna_type()
        self.seen.append(text if text is not None else kind.name)
        return types.SimpleNamespace()

    def menu(self, kind, text="", icon="NONE"):
        assert hasattr(bpy.types, kind) and icon in ICONS

    def template_list(self, kind, _name, data, collection, active_data, active, **_):
        assert hasattr(bpy.types, kind)
        for index, row in enumerate(getattr(data, collection)):
            getattr(panels, kind).draw_item(None, bpy.context, self, data, row, 0, active_data, active, index)

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self.seen.append(text)


def drawn() -> list[str]:
    """What all panels of the tab show."""
    layout = Layout()
    for kind in panels.CLASSES:
        if issubclass(kind, bpy.types.Panel) and kind is not NSM_PT_bones:
            # A panel object exists in a window only: its functions run here on a stand-in with the same
            # layout.
            shown = types.SimpleNamespace(layout=layout)
            if hasattr(kind, "draw_header_preset"):
                kind.draw_header_preset(shown, bpy.context)
            kind.draw(shown, bpy.context)
    return layout.seen


def goals():
    return queue_of(bpy.context.scene).goals


def reason() -> str:
    return running.reason_not_ready(bpy.context)


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
