"""Steps and low walls: where one stands after climbing them."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from scenes import box, furnish, mesh_of_boxes

from nsm_blender.goals.climb import climb_onto
from nsm_blender.goals.resolve import resolve, show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.surroundings import Surroundings
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import heading_to_direction, rotate_planar

SOUTH = (np.array((0.0, -3.0), np.float32), math.pi)


def climb(target, start=SOUTH, frame=None):
    bpy.context.view_layer.update()
    return resolve(GoalSpec("climb", target), bpy.context.scene, frame or WorldFrame(), start)


def block(size, location=(0.0, 0.0), turn=0.0, name="Step"):
    half = np.array(size) * (0.5, 0.5, 1)
    return mesh_of_boxes(name, [((-half[0], -half[1], 0), tuple(half))], (*location, 0), turn)


@pytest.mark.parametrize("turn", [0.0, 0.4, -0.3])
@pytest.mark.parametrize(
    ("come", "facing"), [((0, -3), (0, 1)), ((0, 3), (0, -1)), ((3, 0.2), (-1, 0)), ((-3, 0.2), (1, 0))]
)
def test_one_stands_in_the_middle_of_a_step_and_faces_across_its_edge(come, facing, turn):
    goal = climb(block((1.2, 0.8, 0.3), turn=turn), (rotate_planar(np.array(come, float), turn), 0.0))
    middle = -0.2 * np.array(facing) if facing[0] else np.zeros(2)  # 0.4 m behind the edge, at most
    np.testing.assert_allclose(goal.position, (*rotate_planar(middle, turn), 0.3), atol=0.03)
    np.testing.assert_allclose(
        heading_to_direction(np.array(goal.heading)), rotate_planar(np.array(facing, float), turn), atol=1e-3
    )
    volume = goal.interaction
    np.testing.assert_allclose(sorted(volume.size), (0.3, 0.8, 1.2), atol=0.01)
    assert volume.occupancy.mean() > 0.9


@pytest.mark.parametrize("side", [-1, 1])
def test_a_low_wall_is_stepped_over(side):
    wall = block((2.0, 0.15, 0.4), (1.0, 0.0), name="Wall")
    goal = climb(wall, (np.array((-1.0, side * 0.8)), 0.0))  # rather beside its end than before it
    np.testing.assert_allclose(goal.position, (1.0, -side * (0.075 + 0.6), 0.0), atol=0.03)
    np.testing.assert_allclose(heading_to_direction(np.array(goal.heading)), (0, -side), atol=1e-6)


def test_stairs_and_podiums_have_a_top_that_is_looked_for():
    podium = mesh_of_boxes("Podium", [((-1, -0.6, 0), (1, 1, 0.4)), ((-0.6, -1, 0), (0.6, -0.6, 0.2))])
    goal = climb(podium)
    np.testing.assert_allclose(goal.position, (0.0, -0.2, 0.4), atol=0.03)
    chair, piece = furnish("stool", "Stool", (5.0, 0.0), seat_height=0.45)
    assert climb(chair).position[2] == pytest.approx(0.45, abs=0.01)


def test_what_stands_on_a_podium_is_left_room():
    podium = block((2.0, 2.0, 0.3), name="Podium")
    box("Statue", (-0.3, -0.9, 0.3), (0.3, -0.3, 1.8))
    place = climb(podium).position[:2]
    assert (np.abs(place - (0, -0.6)) - 0.3).max() >= 0.19 and np.abs(place).max() <= 0.81


def test_a_stage_is_climbed_where_one_comes_to_it():
    stage = block((5.4, 4.8, 0.2), name="Stage")
    np.testing.assert_allclose(
        climb(stage, (np.array((1.2, -5.0)), 0.0)).position, (1.2, -2.0, 0.2), atol=0.06
    )


def test_the_goal_point_wins():
    step = block((1.2, 0.8, 0.3))
    point = show_goal_point(GoalSpec("climb", step), bpy.context.scene, WorldFrame(), SOUTH)
    np.testing.assert_allclose(point.matrix_world.translation, (0, 0, 0.3), atol=0.03)
    point.location.x += 0.2
    np.testing.assert_allclose(climb(step).position, np.array(point.location), atol=1e-4)
    point.location.z += 1
    with pytest.raises(GoalError, match="goal point of Step is 1.30 m"):
        climb(step)


def test_a_giant_climbs_what_others_cannot():
    step = block((2.4, 2.4, 1.0))
    with pytest.raises(GoalError, match="1.00 m high"):
        climb(step)
    assert climb(step, frame=WorldFrame(scale=2.0)).position[2] == pytest.approx(0.5, abs=0.01)


class TestWhatCannotBeClimbed:
    def test_too_high_and_too_low(self):
        with pytest.raises(
            GoalError, match="Rock is 0.90 m high; one climbs what is between 0.12 and 0.65 m"
        ):
            climb(block((1, 1, 0.9), name="Rock"))
        with pytest.raises(GoalError, match="Mat is 0.05 m high.*choose walk"):
            climb(block((1, 1, 0.05), name="Mat"))

    def test_no_level_top(self):
        pole = box("Pole", (0, 0, 0), (0.05, 0.05, 0.4))
        with pytest.raises(GeometryError, match="Pole has no level top"):
            climb(pole)

    def test_no_room(self):
        wall = block((2.0, 0.15, 0.4), name="Wall")
        box("Cupboard", (-1, 0.4, 0), (1, 0.9, 2))
        with pytest.raises(GoalError, match="no room to stand 0.6 m behind Wall"):
            climb(wall)
        podium = block((1, 1, 0.3), (5, 0), name="Podium")
        box("Statue", (4.6, -0.4, 0.3), (5.4, 0.4, 1.8))
        with pytest.raises(GoalError, match="no free place to stand on Podium"):
            climb(podium)


@pytest.mark.parametrize(
    ("here", "facing"), [((-0.8, 0.0), (1, 0)), ((1.2, 0.4), (-1, 0)), ((0.6, -3.0), (0, 1))]
)
def test_who_stands_on_a_top_faces_as_one_walks_on_up_there(here, facing):
    podium = block((3.0, 2.0, 0.4), name="Podium")
    around = Surroundings(bpy.context.scene, WorldFrame())
    goal = climb_onto("Mark", podium, np.array((0.6, 0.3, 0.4)), 0.0, around, np.array(here))
    np.testing.assert_allclose(goal.position, (0.6, 0.3, 0.4), atol=0.03)
    np.testing.assert_allclose(heading_to_direction(np.array(goal.heading)), facing, atol=1e-6)
