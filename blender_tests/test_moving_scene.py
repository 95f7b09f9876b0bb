"""Scenes that move while a take runs, and goals that are to be reached at a frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scenes import box, furnish

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import read_back
from nsm_blender.prepare import TakeSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import Take, finish, generate
from nsm_core.body.capsules import BUNDLED, Body
from nsm_core.errors import GoalError

FPS = 24


@pytest.fixture
def character():
    bpy.context.scene.render.fps = FPS
    return add_character((0.0, 0.0, 0.0))


def make(character, *goals: GoalSpec, **more) -> Take:
    return finish(generate(TakeSpec(character, list(goals), **more), bpy.context.scene))


def animate(target, *keys: tuple[int, tuple[float, float, float]]) -> None:
    for frame, place in keys:
        target.location = place
        target.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)


def shown_hips(character, frame: float) -> np.ndarray:
    return read_back(character, [frame])[0][0]


def test_a_seat_is_taken_at_the_frame_that_was_asked_for(character):
    chair, _ = furnish("chair", "Chair", (0.0, -2.0), 0.3)
    by = 190
    take = make(character, GoalSpec("sit", chair, hold=0.4, by=by))
    goal = take.report["goals"][0]
    assert goal["reached"] and "late_seconds" not in goal and goal["position_error_cm"] < 3
    assert take.result.goals[0].end_frame / 30 * FPS + 1 == pytest.approx(by, abs=1.0)
    # It sits there at that frame, and not a second and a half before.
    seat = shown_hips(character, by)
    assert np.linalg.norm(seat - shown_hips(character, by + 8)) < 0.03
    assert np.linalg.norm(seat - shown_hips(character, by - 36)) > 0.1
    take = make(character, GoalSpec("sit", chair, hold=0.4, by=30))
    assert take.report["goals"][0]["reached"] and take.report["goals"][0]["late_seconds"] > 1
    with pytest.raises(GoalError, match="before the take begins"):
        make(character, GoalSpec("sit", chair, by=0))


def test_a_seat_that_moved_is_found_where_it_is_on_arrival(character):
    chair, _ = furnish("chair", "Chair", (0.0, -2.0), 0.3)
    place = tuple(chair.location)
    animate(chair, (1, place), (60, (place[0] + 1.2, place[1] - 0.4, place[2])))
    take = make(character, GoalSpec("sit", chair, hold=0.4))
    goal = take.report["goals"][0]
    assert goal["reached"] and goal["position_error_cm"] < 3
    end = 1 + take.result.goals[0].end_frame / 30 * FPS
    bpy.context.scene.frame_set(round(end))
    seat = np.array(chair.matrix_world.translation)
    assert np.linalg.norm((shown_hips(character, end) - seat)[:2]) < 0.35
    assert tuple(chair.location) != place and chair.animation_data.action is not None


def test_one_who_comes_early_waits_for_a_seat_to_rest_and_one_that_never_rests_is_told(character):
    chair, _ = furnish("chair", "Chair", (0.0, -1.2), 0.3)
    place = tuple(chair.location)
    animate(chair, (1, place), (110, (place[0] + 0.6, place[1], place[2])))
    take = make(character, GoalSpec("sit", chair, hold=0.4))
    assert take.report["goals"][0]["reached"] and take.report["goals"][0]["position_error_cm"] < 3
    assert 1 + take.result.goals[0].end_frame / 30 * FPS > 105
    curve = next(iter(chair.animation_data.action.layers[0].strips[0].channelbags[0].fcurves))
    curve.modifiers.new("CYCLES")
    bpy.context.scene.frame_end = 110
    with pytest.raises(GoalError, match="come to rest at Chair"):
        make(character, GoalSpec("sit", chair, hold=0.4))


def test_a_cart_that_crosses_the_way_is_let_pass(character):
    cart = box("Cart", (-0.4, -0.3, 0.0), (0.4, 0.3, 0.9))
    animate(cart, (1, (-3.0, -1.8, 0.0)), (120, (3.0, -1.8, 0.0)))
    take = make(character, GoalSpec("walk", None, 0.3, location=(0.0, -4.0, 0.0)))
    assert take.report["goals"][0]["reached"]
    deepest = 0.0
    for frame in range(1, take.keyed.last + 1, 2):
        bpy.context.scene.frame_set(frame)
        hips, local = read_back(character, [frame])
        body = Body.of(hips, local, BUNDLED)
        centres = body.centres[0] - np.array(cart.matrix_world.translation)
        away = np.abs(centres) - (0.4, 0.3, 1e9)
        outside = np.linalg.norm(np.maximum(away[:, :2], 0), axis=1) + np.minimum(away[:, :2].max(1), 0)
        deepest = min(deepest, float((outside - body.radii[0])[centres[:, 2] < 0.9].min()))
    assert deepest > -0.03


def test_who_is_animated_already_is_let_pass_and_not_run_into(character):
    bob = add_character((-1.5, -1.5, 0.0))
    bob.rotation_euler.z = 1.57
    make(bob, GoalSpec("walk", None, 0.2, location=(2.2, -1.5, 0.0)))
    # Alone both would be at the crossing at the same time.
    take = make(character, GoalSpec("walk", None, 0.2, location=(0.0, -3.6, 0.0)))
    assert take.report["goals"][0]["reached"]
    deepest = 0.0
    for frame in range(1, take.keyed.last + 1, 2):
        bodies = [Body.of(*read_back(one, [frame]), BUNDLED) for one in (character, bob)]
        a, b = bodies
        gaps = np.linalg.norm(a.centres[0][:, None] - b.centres[0], axis=2) - a.radii[0][:, None] - b.radii[0]
        deepest = min(deepest, float(gaps.min()))
    assert deepest > -0.03
