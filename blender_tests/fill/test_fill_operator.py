"""Fill as a button and a menu entry: reviewed, undone and varied as takes are."""

from __future__ import annotations

import bpy
import pytest
from everything import difference, digest
from gaps import END, START, cut, outside, playing, walking
from modal import Modal, Window

from nsm_blender.ui import running
from nsm_blender.ui.operators import modal as stepping
from nsm_blender.ui.operators.fill import NSM_OT_fill
from nsm_blender.ui.reviews import pending

pytestmark = pytest.mark.usefixtures("addon")


@pytest.fixture
def hero(hero):
    """The character of the sidebar, filled by interpolation."""
    scene = bpy.context.scene
    scene.nsm.character, scene.nsm.fill.method = hero, "interpolate"
    return hero


def test_a_fill_is_accepted_or_rejected_and_varied(hero):
    scene, old, before = bpy.context.scene, hero.animation_data.action, outside(hero, START, END)
    assert bpy.ops.nsm.fill() == {"FINISHED"}
    first = hero.animation_data.action
    assert first != old and old.use_fake_user
    record = pending(scene)
    assert record.character.action == first and (record.frame_start, record.frame_end) == (START + 1, END - 1)
    assert scene.nsm.results[0].text.startswith("25 frames filled between 40 and 66")
    # Another variation begins from the same keys and leaves the first on the list.
    assert bpy.ops.nsm.another_fill() == {"FINISHED"}
    second = hero.animation_data.action
    assert second not in (old, first) and len(scene.nsm.takes) == 2 and scene.nsm.fill.seed == 1
    assert {p: k for p, k in outside(hero, START, END).items() if p in before} == before
    assert bpy.ops.nsm.take_reject() == {"FINISHED"}
    assert hero.animation_data.action == old and outside(hero, START, END) == before
    assert bpy.ops.nsm.take_show(index=0) == {"FINISHED"}
    assert hero.animation_data.action == first
    assert bpy.ops.nsm.take_accept() == {"FINISHED"}
    assert pending(scene) is None


def test_filling_again_takes_the_place_of_the_first_and_keeps_what_was_edited(hero):
    old = hero.animation_data.action
    assert bpy.ops.nsm.fill() == {"FINISHED"}
    count = len(bpy.data.actions)
    assert bpy.ops.nsm.fill() == {"FINISHED"}  # the playhead is still in the gap
    assert len(bpy.data.actions) == count and len(bpy.context.scene.nsm.takes) == 1
    arm = hero.pose.bones["RightElbow"]
    arm.rotation_quaternion = (0.9, 0.4, 0.1, 0.0)
    arm.keyframe_insert("rotation_quaternion", frame=52)
    assert bpy.ops.nsm.fill() == {"FINISHED"}
    curves = {(c.data_path, c.array_index): c for c in playing(hero)}
    path = arm.path_from_id("rotation_quaternion")
    assert curves[path, 1].evaluate(52) == pytest.approx(0.4, abs=1e-6)
    assert "RightElbow" in bpy.context.scene.nsm.results[1].text
    bpy.ops.nsm.take_reject()  # the edited one was kept as if accepted
    bpy.ops.nsm.take_remove(index=0)
    assert hero.animation_data.action == old


def test_the_menus_fill_between_selected_keys(hero):
    cut(hero, 20, 34)
    for curve in playing(hero):
        for key in curve.keyframe_points:
            key.select_control_point = key.co.x in (20, 34)
    assert bpy.ops.nsm.fill(where="MENU") == {"FINISHED"}
    assert pending(bpy.context.scene).frame_start == 21 and pending(bpy.context.scene).frame_end == 33
    for curve in playing(hero):
        for key in curve.keyframe_points:
            key.select_control_point = False
    assert bpy.ops.nsm.fill(where="MENU") == {"FINISHED"}
    assert pending(bpy.context.scene).frame_start == START + 1


def test_keys_of_some_bones_are_filled_alone(hero):
    cut(hero, 20, 34)
    for curve in playing(hero):
        for key in curve.keyframe_points:
            key.select_control_point = key.co.x in (20, 34) and "RightElbow" in curve.data_path
    for again in (False, True):
        operator = bpy.ops.nsm.another_fill if again else bpy.ops.nsm.fill
        assert operator(**({} if again else {"where": "MENU"})) == {"FINISHED"}
        counts = {
            len([k for k in curve.keyframe_points if 20 < k.co.x < 34]): curve.data_path
            for curve in playing(hero)
            if len(curve.keyframe_points) > 2
        }
        assert counts.keys() == {0, 13} and "RightElbow" in counts[13]
        assert bpy.context.scene.nsm.results[0].text.startswith("13 frames of 1 bone filled")


def test_one_undo_step_takes_a_fill_back(hero):
    before, old = outside(hero, START, END), hero.animation_data.action.name
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.nsm.fill() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="filled")
    bpy.ops.ed.undo()
    hero = bpy.data.objects["Character"]
    assert hero.animation_data.action.name == old and outside(hero, START, END) == before
    assert not len(bpy.context.scene.nsm.takes)


def test_in_a_window_it_is_done_step_by_step_and_escape_puts_everything_back(hero, monkeypatch):
    monkeypatch.setattr(stepping, "_BUDGET", 0.0)
    before = digest()
    for ticks in (1, 12, 40, 90):
        window = Modal(Window(), NSM_OT_fill)
        assert window._start(window.window) == {"RUNNING_MODAL"}
        for _ in range(ticks):
            assert window.event("TIMER") == {"RUNNING_MODAL"}
        assert window.event("ESC") == {"CANCELLED"}
        assert window.reports[-1][1] == "Fill was cancelled; everything is as it was."
        assert running.current() is None and not difference(before, digest()), ticks
    window = Modal(Window(), NSM_OT_fill)
    window._start(window.window)
    while (state := window.event("TIMER")) == {"RUNNING_MODAL"}:
        pass
    assert state == {"FINISHED"} and pending(bpy.context.scene).frame_start == START + 1


def test_a_change_meanwhile_ends_it_with_a_sentence(hero):
    window = Modal(Window(), NSM_OT_fill)
    window._start(window.window)
    window.event("TIMER")
    hero.pose.bones["Head"].rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    while window.event("TIMER") == {"RUNNING_MODAL"}:
        pass
    told = bpy.context.scene.nsm.results[0].text
    assert (
        told
        == "Character was moved or posed meanwhile, so Fill stopped and nothing was keyed; generate again."
    )
    assert pending(bpy.context.scene) is None


def test_buttons_say_why_they_are_off(hero):
    assert bpy.ops.nsm.fill.poll() and not bpy.ops.nsm.another_fill.poll()
    hero.animation_data.action = None
    assert not bpy.ops.nsm.fill.poll()
    scene = bpy.context.scene
    scene.nsm.fill.where = "PREVIEW"
    walking(hero, 30)
    with pytest.raises(RuntimeError, match="no preview range"):
        bpy.ops.nsm.fill()
    scene.nsm.fill.where = "SELECTED"
    for curve in playing(hero):
        for key in curve.keyframe_points:
            key.select_control_point = False
    with pytest.raises(RuntimeError, match="Fewer than two frames"):
        bpy.ops.nsm.fill()
    scene.use_preview_range, scene.nsm.fill.where = True, "PREVIEW"
    scene.frame_preview_start, scene.frame_preview_end = 20, 40
    scene.nsm.fill.replace = True
    assert bpy.ops.nsm.fill() == {"FINISHED"} and pending(scene).frame_end == 39
