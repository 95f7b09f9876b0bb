"""What is walked over in a scene, where the floor of a character is, and takes over it."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scenes import box, furnish, mesh_of_boxes

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.prepare import TakeSpec, start_of
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import finish, generate
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.ground import floor_under
from nsm_blender.world.surroundings import Surroundings


def heights(*places) -> np.ndarray:
    return Surroundings(bpy.context.scene, WorldFrame()).ground.height(np.array(places, float))


def solid(*places) -> np.ndarray:
    return Surroundings(bpy.context.scene, WorldFrame()).query.signed_distance(
        np.array(places, np.float32), 0.2
    )


@pytest.mark.parametrize(("size", "ground"), [
    ((3.0, 2.0, 0.04), True), ((0.6, 0.4, 0.02), True), ((0.9, 0.1, 0.035), True), ((4.0, 0.2, 0.12), True),
    ((0.3, 0.2, 0.06), False), ((0.25, 0.25, 0.1), False), ((2.0, 2.0, 0.15), False),
])  # fmt: skip
def test_rugs_thresholds_and_kerbs_are_ground_and_clutter_and_steps_are_not(size, ground):
    box("Thing", (-size[0] / 2, -size[1] / 2, 0.0), (size[0] / 2, size[1] / 2, size[2]))
    assert heights((0, 0))[0] == pytest.approx(size[2] if ground else 0.0, abs=1e-4)
    assert (solid((0, 0, size[2] + 0.05))[0] > 0.19) == ground


def test_the_low_edge_of_a_room_is_ground_and_its_walls_are_solid():
    parts = [((-3, -3, -0.1), (3, 3, 0.0)), ((-3, 1, 0.0), (3, 3, 0.1)), ((-3, 3, 0.0), (3, 3.1, 2.5))]
    mesh_of_boxes("Room", parts)
    assert heights((0, 2), (0, 0)) == pytest.approx((0.1, 0.0), abs=1e-4)
    assert solid((0, 2.9, 1.0), (0, 2, 0.3)) == pytest.approx((0.1, 0.2), abs=0.01)


def test_who_stands_on_a_rug_has_its_floor_under_it():
    box("Rug", (-1, -1, 0.0), (1, 1, 0.05))
    box("Shelf", (4, -1, 1.0), (6, 1, 1.05))
    box("Slab", (-9, 5, -0.1), (9, 9, 0.0))
    for place, floor in (
        ((0, 0, 0.05), 0.0),
        ((0, 0, 0.0), 0.0),
        ((3, 0, 0.0), 0.0),
        ((5, 0, 1.05), 1.05),
        ((0, 7, 0.0), 0.0),
    ):
        assert floor_under(np.array(place, float), 1.0, bpy.context.scene, ()) == pytest.approx(
            floor, abs=1e-6
        ), place
    character = add_character((0.2, 0.1, 0.05))
    frame, _ = start_of(character, bpy.context.scene)
    assert frame.floor == pytest.approx(0.0, abs=1e-6)


def test_a_take_begins_on_a_rug_leaves_it_and_sits_on_another():
    box("Rug", (-1, -1, 0.0), (1, 1, 0.04))
    chair, _ = furnish("chair", "Chair", (0.0, -3.5))
    chair.location.z = 0.06
    box("Mat", (-1.2, -5, 0.0), (1.2, -2.4, 0.06))
    character = add_character((0.0, 0.0, 0.04))
    take = finish(generate(TakeSpec(character, [GoalSpec("sit", chair, 0.3)]), bpy.context.scene))
    report = take.report
    assert report["goals"][0]["reached"] and report["goals"][0]["position_error_cm"] < 3
    # 5 cm of the calf at a leg of the chair, as on a flat floor.
    assert report["penetration_cm"] < 6 and report["below_floor_share"] < 0.035
    bones = character.pose.bones
    for frame, z in ((report["frames"], 0.06), (1, 0.04)):
        bpy.context.scene.frame_set(frame)
        toe = character.matrix_world @ bones["RightToe"].head
        assert toe.z - z == pytest.approx(0.025, abs=0.02)
