"""Looking at the scene in idle slices: what a timer would do, tick by tick, while an animator goes on
working.
"""

from __future__ import annotations

import bpy
import pytest
from scenes import furnish

import nsm_blender
from nsm_blender.ui import lookout, overlays, running


@pytest.fixture
def room():
    nsm_blender.register()
    bpy.ops.nsm.add_character()
    chair, _ = furnish(position=(0.4, -2.3))
    row = bpy.context.scene.nsm.character.nsm_queue.goals.add()
    row.object, row.action = chair, "sit"
    bpy.context.view_layer.update()
    yield bpy.context.scene, chair, row
    running.end_take()
    nsm_blender.unregister()


def ticks(most: int = 5000) -> int:
    """Tick until there is nothing left to do; how often that was."""
    for count in range(most):
        if lookout.tick() is None:
            return count
        lookout._due = 0.0  # as if the animator had rested
    raise AssertionError("it never ends")


def test_a_look_is_made_in_many_slices_and_leaves_the_frame_alone(room):
    scene, _, row = room
    scene.frame_set(7)
    scene.nsm.start_frame = 30
    lookout.ask(scene)
    assert lookout.under_way()
    assert ticks() > 3 and not lookout.under_way()
    assert lookout.told_of(scene, 0, row).problem == "" and scene.frame_current == 7
    assert {"colliders", "goals", "way"} <= {key for key in lookout._look.shapes}


@pytest.mark.parametrize("change", ["move", "frame"])
def test_what_changes_on_the_way_is_looked_at_anew(room, change):
    scene, chair, row = room
    lookout.ask(scene)
    for _ in range(4):
        lookout.tick()
    if change == "move":
        chair.location.x += 1.0
        bpy.context.view_layer.update()
    else:
        scene.frame_set(scene.frame_current + 3)
    ticks()
    goal = lookout.told_of(scene, 0, row).goal
    assert abs(goal.position[0] - chair.location.x) < 0.1, "it is the scene as it is now"


def test_it_waits_while_a_take_is_made(room):
    scene, _, row = room
    lookout.ask(scene)
    running.begin_take(scene, scene.nsm.character)
    for _ in range(20):
        assert lookout.tick() > 0.1
    assert lookout.told_of(scene, 0, row) is None and lookout.under_way()
    running.end_take()
    ticks()
    assert lookout.told_of(scene, 0, row) is not None


@pytest.mark.parametrize("lost", ["chair", "character", "scene"])
def test_what_is_deleted_on_the_way_ends_it_without_a_trace(room, lost):
    scene, chair, _ = room
    lookout.ask(scene)
    for _ in range(5):
        lookout.tick()
    if lost == "scene":
        bpy.context.window_manager.windows[0].scene = bpy.data.scenes.new("Other")
        bpy.data.scenes.remove(scene)
    else:
        bpy.data.objects.remove(chair if lost == "chair" else scene.nsm.character)
        bpy.context.view_layer.update()
    ticks()
    assert not lookout.under_way()
    if lost == "character":
        assert "No character is chosen" in lookout.problem(scene)
    if lost == "chair":
        assert "has no object" in lookout._look.by_row[0].problem


def test_a_goal_that_is_picked_is_shown_once_it_is_known(room, monkeypatch):
    from nsm_blender.overlays import viewport

    scene, _, row = room
    lookout.ask(scene)
    ticks()
    assert "picked" in viewport._drawn, "the row that is chosen"
    overlays.toggles().goals = True
    assert "picked" not in viewport._drawn and "goals" in viewport._drawn, "all are"
    overlays.toggles().goals = False
    row.action = "walk"
    overlays.goal_picked(scene)
    assert "picked" not in viewport._drawn, "what it asks for now was not looked at"


def test_undoing_and_switching_off_break_a_look_off(room):
    scene, _, _ = room
    for end in (overlays._before_undo, nsm_blender.unregister):
        lookout.ask(scene)
        for _ in range(4):
            lookout.tick()
        end()
        assert not lookout.under_way() and lookout.seen(scene) is None
