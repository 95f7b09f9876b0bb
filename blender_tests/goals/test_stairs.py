"""Flights of stairs: found in one mesh or in treads of their own, climbed, and walked down again."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from scenes import box, empty, mesh_of_boxes

from nsm_blender.goals.guess import guess
from nsm_blender.goals.resolve import resolve
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.prepare import TakeSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import finish, generate
from nsm_blender.world.frame import WorldFrame
from nsm_core.rotations import heading_to_direction

START = (np.array((0.0, -2.0), np.float32), math.pi)
STEPS, RISER, TREAD = 4, 0.17, 0.28
TREADS = [((-0.6, k * TREAD, 0.0), (0.6, (k + 1) * TREAD, (k + 1) * RISER)) for k in range(STEPS - 1)]
LANDING = ((-1.2, 3 * TREAD, 0.0), (1.2, 3 * TREAD + 2.0, STEPS * RISER))
TOP = STEPS * RISER


def goal(action, target=None, **more):
    bpy.context.view_layer.update()
    return resolve(GoalSpec(action, target, **more), bpy.context.scene, WorldFrame(), START)


def is_up(found):
    assert found.action == "climb"
    np.testing.assert_allclose(found.position, (0, 3 * TREAD + 0.6, TOP), atol=0.02)
    np.testing.assert_allclose(heading_to_direction(np.array(found.heading)), (0, 1), atol=1e-3)


def test_a_stair_mesh_is_climbed_to_its_landing():
    is_up(goal("climb", mesh_of_boxes("Stairs", [*TREADS, LANDING])))


def test_what_looks_like_stairs_is_guessed_to_be_climbed():
    assert guess(mesh_of_boxes("Thing", [*TREADS, LANDING]), WorldFrame()) == "climb"
    shelf = [((-0.5, 0.0, 0.3 * k), (0.5, 0.3, 0.3 * k + 0.03)) for k in range(5)]
    assert guess(mesh_of_boxes("Other", shelf), WorldFrame()) != "climb"


def test_treads_that_are_objects_of_their_own_are_a_flight_and_what_it_leads_to_is_its_landing():
    treads = [box(f"Tread {k}", *corners) for k, corners in enumerate(TREADS)]
    landing = box("Landing", *LANDING)
    is_up(goal("climb", treads[1]))
    is_up(goal("climb", landing))
    place = goal("walk", empty("Mark", (0.5, 2.0, TOP)))
    assert place.action == "walk"
    np.testing.assert_allclose(place.position, (0.5, 2.0, TOP), atol=1e-5)


def test_a_character_goes_up_and_down_again():
    character = add_character((0.0, -1.4, 0.0))
    stairs = mesh_of_boxes("Stairs", [*TREADS, LANDING])
    goals = [
        GoalSpec("climb", stairs, hold=0.2),
        GoalSpec("walk", None, hold=0.2, location=(0.0, -1.5, 0.0)),
    ]
    take = finish(generate(TakeSpec(character, goals, seed=1), bpy.context.scene))
    up, down = take.report["goals"]
    assert up["reached"] and down["reached"]
    hips = take.result.hips_position[:, 2]
    at = take.result.goals[0].end_frame
    assert hips[at] - hips[0] == pytest.approx(TOP, abs=0.06) and hips[-1] == pytest.approx(hips[0], abs=0.06)
    assert take.report["penetration_cm"] < 12
