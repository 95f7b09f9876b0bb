"""A click into the viewport is a place: on the floor, on what one stands on, before what is steep."""

from __future__ import annotations

import bpy
import pytest
from mathutils import Vector
from scenes import box

from nsm_blender.rigs.character import add_character
from nsm_blender.ui.operators.pick import picked
from nsm_blender.ui.properties import queue_of, settings_of

DOWN, ALONG = Vector((0, 0, -1)), Vector((0, 1, -0.2))


@pytest.fixture
def scene(registered):
    return registered


def at(scene, x: float, y: float, direction=DOWN, z: float = 4.0):
    return picked(scene, Vector((x, y, z)), direction)


def test_floor_tops_and_what_is_steep(scene):
    box("Crate", (2, 2, 0), (3, 3, 0.5))
    assert at(scene, 1, 1)[:] == pytest.approx((1, 1, 0)), "the floor needs no object"
    assert at(scene, 2.5, 2.5)[:] == pytest.approx((2.5, 2.5, 0.5))
    assert at(scene, 2.5, 1.0, ALONG, 0.6)[:] == pytest.approx((2.5, 1.65, 0.0), abs=1e-4), "before its side"
    assert at(scene, 0, 0, Vector((0, 1, 0.1))) is None, "the sky"


def test_the_character_is_looked_through_and_has_a_floor_of_its_own(scene):
    settings_of(scene).character = add_character(location=(0, 0, 1.5))
    bpy.context.view_layer.update()
    assert at(scene, 0, 0)[:] == pytest.approx((0, 0, 1.5), abs=1e-4)


def test_the_place_goes_to_the_chosen_goal_or_a_new_one(scene):
    queue = queue_of(scene)
    bpy.ops.nsm.goal_pick(location=(1, 2, 0))
    assert len(queue.goals) == 1 and queue.goals[0].action == "walk" and queue.goals[0].location[1] == 2
    queue.goals[0].action = "run"
    bpy.ops.nsm.goal_pick(location=(3, 2, 0))
    assert len(queue.goals) == 1 and queue.goals[0].action == "run" and queue.goals[0].location[0] == 3
    queue.goals[0].action = "idle"
    bpy.ops.nsm.goal_pick(location=(4, 2, 0))
    assert [g.action for g in queue.goals] == ["idle", "walk"] and queue.active_goal == 1
