"""Goals from Blender objects: where the seat is, what the animator's goal point changes, what cannot be a
goal.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scenes import box, empty, furnish

from nsm_blender.goals.points import goal_point_of
from nsm_blender.goals.resolve import resolve, show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.skeleton import HIP_OVER_SEAT
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.scene.furniture import cuboids
from nsm_core.world.sensors.interaction import interaction_sensor

START = (np.zeros(2, np.float32), 0.0)


def sit_goal(target, frame=None):
    bpy.context.view_layer.update()
    return resolve(GoalSpec("sit", target), bpy.context.scene, frame or WorldFrame(), START)


def expected(piece, position, heading):
    """Hip goal (3,) and heading by the furniture's own exact seat."""
    hips = rotate_planar(piece.seat.point, np.float32(heading)) + np.array((*position, HIP_OVER_SEAT))
    return hips, piece.seat.heading + heading


def assert_close(goal, hips, heading, metres=0.05, degrees=5.0):
    assert np.linalg.norm(np.asarray(goal.position) - hips) < metres
    assert abs(math.degrees(wrap_angle(goal.heading - heading))) < degrees


@pytest.mark.parametrize("kind", ["chair", "armchair", "sofa"])
@pytest.mark.parametrize("heading", [0.0, 1.1, -2.5])
def test_seat_is_found_wherever_the_object_stands(kind, heading):
    chair, piece = furnish(kind, position=(1.5, -0.7), heading=heading)
    assert_close(sit_goal(chair), *expected(piece, (1.5, -0.7), heading))


def test_seat_of_a_mesh_that_was_modelled_with_y_up():
    chair, piece = furnish()
    chair.modifiers.clear()
    chair.data.transform(Matrix.Rotation(-math.pi / 2, 4, "X"))
    chair.matrix_world = Matrix.Translation((1, 2, 0)) @ Matrix.Rotation(math.pi / 2, 4, "X")
    assert_close(sit_goal(chair), *expected(piece, (1, 2), 0.0))


def test_seat_of_a_mirrored_and_of_a_parented_object():
    chair, piece = furnish(heading=0.4)
    chair.scale.x = -1
    holder = empty("Holder", (2.0, 1.0, 0.0), 0.9)
    chair.parent = holder
    hips, heading = expected(piece, (0, 0), 0.4)
    assert_close(sit_goal(chair), rotate_planar(hips, 0.9) + (2, 1, 0), heading + 0.9)


def test_seat_of_parts_under_an_empty():
    chair, piece = furnish(position=(0.0, 1.0), heading=0.8)
    holder = empty("Group", (0.0, 1.0, 0.0), 0.8)
    chair.parent, chair.matrix_parent_inverse = holder, holder.matrix_world.inverted()
    assert_close(sit_goal(holder), *expected(piece, (0, 1), 0.8))


def test_a_half_sized_character_sees_a_half_sized_chair_as_its_own():
    chair, piece = furnish(position=(1.0, 0.0), heading=0.5)
    chair.scale = (0.5, 0.5, 0.5)
    chair.location.z = 0.2
    goal = sit_goal(chair, WorldFrame(scale=0.5, floor=0.2))
    hips, heading = expected(piece, (2.0, 0.0), 0.5)
    assert_close(goal, hips, heading)


def test_interaction_sensor_reads_what_training_reads():
    chair, piece = furnish("armchair", position=(0.6, 0.4), heading=-0.7)
    volume = sit_goal(chair).interaction
    place = np.array((0.6, 0.4, 0.0), np.float32)
    centre = rotate_planar(piece.centre.astype(np.float32), np.float32(-0.7)) + place
    exact = interaction_sensor(cuboids([(piece, place, -0.7)]), centre, piece.size, -0.7)
    assert np.abs(volume.size - exact.size).max() < 0.02
    assert np.abs(volume.occupancy - exact.occupancy).mean() < 0.05


def test_the_interaction_sensor_ignores_other_objects():
    chair, _ = furnish()
    alone = sit_goal(chair).interaction.occupancy
    box("Table", (-0.3, -0.3, 0.3), (0.3, 0.3, 0.9))
    np.testing.assert_array_equal(sit_goal(chair).interaction.occupancy, alone)


def test_goal_point_marks_the_seat_and_the_animators_edit_wins():
    chair, piece = furnish(position=(1.0, 1.0), heading=0.3)
    point = show_goal_point(GoalSpec("sit", chair), bpy.context.scene, WorldFrame(), START)
    assert point.name == "NSM Goal Chair" and point.type == "EMPTY"
    hips, heading = expected(piece, (1.0, 1.0), 0.3)
    assert np.linalg.norm(np.array(point.matrix_world.translation) - (hips - (0, 0, HIP_OVER_SEAT))) < 0.05
    assert_close(sit_goal(chair), hips, heading)
    before = sit_goal(chair)
    point.matrix_world = (
        Matrix.Translation((0.05, -0.1, 0.03)) @ point.matrix_world @ Matrix.Rotation(0.5, 4, "Z")
    )
    after = sit_goal(chair)
    np.testing.assert_allclose(after.position - before.position, (0.05, -0.1, 0.03), atol=1e-5)
    assert after.heading == pytest.approx(before.heading + 0.5, abs=1e-5)


def test_goal_point_follows_its_object_and_its_removal_brings_the_guess_back():
    chair, piece = furnish()
    point = show_goal_point(GoalSpec("sit", chair), bpy.context.scene, WorldFrame(), START)
    chair.location, chair.rotation_euler.z = (2.0, -1.0, 0.0), 1.0
    assert_close(sit_goal(chair), *expected(piece, (2, -1), 1.0))
    bpy.data.objects.remove(point)
    assert goal_point_of(bpy.context.scene, chair, "sit") is None
    assert_close(sit_goal(chair), *expected(piece, (2, -1), 1.0))


def test_showing_goal_points_again_keeps_the_edit():
    chair, _ = furnish()
    point = show_goal_point(GoalSpec("sit", chair), bpy.context.scene, WorldFrame(), START)
    point.location.x += 0.07
    bpy.context.view_layer.update()
    moved = point.matrix_world.copy()
    assert show_goal_point(GoalSpec("sit", chair), bpy.context.scene, WorldFrame(), START) == point
    assert point.matrix_world == moved


def test_a_goal_point_makes_a_seat_where_the_mesh_shows_none():
    crate = box("Rock", (-0.4, -0.4, 0.0), (0.4, 0.4, 1.6))
    with pytest.raises(GeometryError, match="Rock"):
        sit_goal(crate)
    point = empty("Ledge", (0.0, -0.5, 0.5))
    point["nsm_goal_of"], point["nsm_action"] = crate, "sit"
    goal = sit_goal(crate)
    np.testing.assert_allclose(goal.position, (0, -0.5, 0.5 + HIP_OVER_SEAT), atol=1e-5)
    assert goal.heading == pytest.approx(0.0, abs=1e-6)


def test_walk_goals():
    scene = bpy.context.scene
    there = resolve(GoalSpec("walk", None, location=(2.0, 0.0, 0.1)), scene, WorldFrame(), START)
    np.testing.assert_allclose(there.position, (2, 0, 0), atol=1e-6)
    assert there.heading == pytest.approx(math.pi / 2)
    mark = empty("Mark", (-1.0, 3.0, 0.0), 0.8)
    marked = resolve(GoalSpec("walk", mark), scene, WorldFrame(), START)
    np.testing.assert_allclose(marked.position, (-1, 3, 0), atol=1e-6)
    assert marked.heading == pytest.approx(0.8, abs=1e-6)
    table, piece = furnish("table", "Table", (3.0, 0.0), math.pi / 2)
    before = resolve(GoalSpec("walk", table), scene, WorldFrame(), START)
    # Its front, -Y turned to +X, with room to stand.
    assert before.position[0] > 3.0 + piece.size[1] / 2 + 0.3
    assert abs(wrap_angle(before.heading + math.pi / 2)) < 1e-5
    still = resolve(GoalSpec("idle"), scene, WorldFrame(), (np.array((4.0, 5.0)), 0.7))
    np.testing.assert_allclose(still.position, (4, 5, 0))
    assert still.heading == pytest.approx(0.7)


class TestWhatCannotBeAGoal:
    def test_no_object(self):
        with pytest.raises(GoalError, match="choose one"):
            sit_goal(None)

    def test_deleted_object(self):
        chair, _ = furnish()
        bpy.context.scene.collection.objects.unlink(chair)
        with pytest.raises(GoalError, match="Chair is no longer in the scene"):
            sit_goal(chair)

    def test_empty_mesh(self):
        chair, _ = furnish()
        chair.modifiers.clear()
        chair.data.clear_geometry()
        with pytest.raises(GeometryError, match="Chair"):
            sit_goal(chair)

    def test_object_without_a_mesh(self):
        with pytest.raises(GeometryError, match="Nothing Here"):
            sit_goal(empty("Nothing Here", (0, 0, 0)))

    def test_mesh_without_a_seat(self):
        wall, _ = furnish("wall", "Wall")
        with pytest.raises(GeometryError, match="Wall"):
            sit_goal(wall)

    def test_seat_out_of_reach(self):
        chair, _ = furnish()
        point = show_goal_point(GoalSpec("sit", chair), bpy.context.scene, WorldFrame(), START)
        point.location.z += 1.0
        with pytest.raises(GoalError, match="move the goal point"):
            sit_goal(chair)

    def test_unknown_action(self):
        with pytest.raises(GoalError, match="sit, walk, idle, run, carry, open, climb"):
            resolve(GoalSpec("fly", box("Box", (0, 0, 0), (1, 1, 1))), bpy.context.scene, WorldFrame(), START)

    def test_goal_point_that_looks_up(self):
        mark = empty("Mark", (0, 0, 0))
        mark.rotation_euler = (math.pi / 2, 0, 0)
        bpy.context.view_layer.update()
        with pytest.raises(GoalError, match="Mark"):
            resolve(GoalSpec("walk", mark), bpy.context.scene, WorldFrame(), START)
