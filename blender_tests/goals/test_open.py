"""Leaves of doors: hinge, handle and swing from the mesh, and the animator's empties that win."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scenes import LEAF, box, door, empty, mesh_of_boxes

from nsm_blender.goals.points import HANDLE, HINGE, SWING, goal_point_of
from nsm_blender.goals.resolve import place_after, resolve, show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.world.frame import WorldFrame
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.affordances.passage import passage
from nsm_core.world.scene.props import Leaf

START = (np.array((0.4, -2.0), np.float32), math.pi)


def opening(leaf, frame=None, start=START):
    bpy.context.view_layer.update()
    return resolve(GoalSpec("open", leaf), bpy.context.scene, frame or WorldFrame(), start)


def points_of(leaf):
    return tuple(goal_point_of(bpy.context.scene, leaf, part) for part in (HINGE, HANDLE))


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_a_leaf_with_its_origin_at_the_hinge(turn):
    goal = opening(door((1.0, 2.0, 0.0), turn))
    leaf = goal.prop
    assert isinstance(leaf, Leaf) and leaf.name == "Door"
    np.testing.assert_allclose(leaf.pose[:3], (1, 2, 0), atol=1e-4)
    assert abs(wrap_angle(leaf.pose[3] - turn)) < 1e-4 and leaf.closed == leaf.pose[3]
    assert leaf.width == pytest.approx(LEAF[0], abs=1e-4)
    np.testing.assert_allclose(leaf.handle, (LEAF[0] - 0.06, 0, 1.015), atol=1e-3)
    assert 0.08 <= leaf.thickness <= 0.2
    middle = np.array((1, 2)) + rotate_planar(np.array((LEAF[0] / 2, 0)), turn)
    np.testing.assert_allclose(goal.position, (*middle, 0), atol=1e-3)
    way = passage(leaf, START[0])
    assert goal.heading == pytest.approx(way.heading)
    np.testing.assert_allclose(place_after(goal, START, None)[0], way.beyond, atol=1e-5)
    inside = leaf.query.signed_distance(np.array(((0.4, 0, 1.0), (0.4, 0.1, 1.5)), np.float32), 0.3)
    assert inside[0] < 0.01 and inside[1] == pytest.approx(0.08, abs=1e-3)
    assert leaf.volume.size[0] == pytest.approx(LEAF[0], abs=1e-3)


def test_the_hinge_at_the_other_edge_turns_the_frame_round():
    w, t, h = LEAF
    leaf = mesh_of_boxes("Door", [((-w, -t / 2, 0.005), (0, t / 2, h))], (2.0, 1.0, 0.0))
    prop = opening(leaf).prop
    np.testing.assert_allclose(prop.pose[:2], (2, 1), atol=1e-4)
    assert abs(wrap_angle(prop.closed - math.pi)) < 1e-4
    np.testing.assert_allclose(prop.grip(0)[:2], (2 - w + 0.06, 1), atol=1e-3)
    np.testing.assert_allclose(prop.handle[2], 1.0, atol=1e-6)


def test_a_leaf_modelled_along_y():
    w, t, h = LEAF
    prop = opening(mesh_of_boxes("Door", [((-t / 2, 0, 0), (t / 2, w, h))], (1.0, 1.0, 0.0))).prop
    np.testing.assert_allclose(prop.pose[:2], (1, 1), atol=1e-4)
    np.testing.assert_allclose(prop.to_world(np.array((w, 0, 0)))[:2], (1, 1 + w), atol=1e-3)


def test_without_an_origin_at_an_edge_a_part_called_hinge_tells():
    leaf = door(origin="middle")
    pin = mesh_of_boxes("Hinge Pin", [((-0.01, -0.01, 0.2), (0.01, 0.01, 0.3))], (LEAF[0], 0.0, 0.0))
    pin.parent, pin.matrix_parent_inverse = leaf, leaf.matrix_world.inverted()
    np.testing.assert_allclose(opening(leaf).prop.pose[:2], (LEAF[0], 0), atol=0.02)


def test_the_handle_is_at_the_free_edge_wherever_the_origin_is():
    leaf = door(origin="middle")
    np.testing.assert_allclose(opening(leaf).prop.pose[:2], (0, 0), atol=1e-3)
    leaf.scale.x = -1
    prop = opening(leaf).prop
    np.testing.assert_allclose(prop.pose[:2], (LEAF[0], 0), atol=1e-3)
    np.testing.assert_allclose(prop.grip(0)[:2], (0.06, 0), atol=1e-3)
    leaf.scale.x = 1
    # The origin at the lock, as in a double door modelled in place.
    leaf.data.transform(Matrix.Translation((-LEAF[0] / 2, 0, 0)))
    leaf.location.x += LEAF[0] / 2
    np.testing.assert_allclose(opening(leaf).prop.pose[:2], (0, 0), atol=1e-3)


def test_a_frame_is_no_leaf():
    with pytest.raises(GoalError, match="Frame measures .* without its frame"):
        posts = [((x, -0.07, 0), (x + 0.1, 0.07, 2.1)) for x in (0.0, 0.9)]
        opening(mesh_of_boxes("Frame", [*posts, ((0, -0.07, 2), (1, 0.07, 2.1))]))


def test_else_the_edge_by_the_frame_is_the_hinge_and_else_the_left_one():
    leaf = door(origin="middle", handle=False)
    bpy.data.objects.remove(bpy.data.objects["Wall"])
    np.testing.assert_allclose(opening(leaf).prop.pose[:2], (0, 0), atol=1e-3)
    box("Post", (LEAF[0] + 0.01, -0.1, 0.0), (LEAF[0] + 0.2, 0.1, 2.2))
    np.testing.assert_allclose(opening(leaf).prop.pose[:2], (LEAF[0], 0), atol=1e-3)


@pytest.mark.parametrize("turn", [0.0, 1.3])
@pytest.mark.parametrize("aside", [-0.04, 0.04])
def test_a_leaf_opens_to_the_side_of_the_wall_on_which_it_sits(aside, turn):
    prop = opening(door(aside=aside, turn=turn)).prop
    assert prop.swing == math.copysign(1, aside)
    free_edge = rotate_planar(prop.to_world(np.array((prop.width, 0, 0)), prop.pose_at(0.5))[:2], -turn)
    assert free_edge[1] * aside > 0


def test_a_leaf_does_not_open_into_a_cupboard():
    leaf = door()
    assert opening(leaf).prop.swing == 1
    box("Cupboard", (0.1, 0.3, 0.0), (0.7, 0.9, 1.8))
    assert opening(leaf).prop.swing == -1


def test_both_ways_through():
    leaf = door(aside=0.04)
    there, back = opening(leaf), opening(leaf, start=(np.array((0.4, 2.0)), 0.0))
    ways = passage(there.prop, START[0]), passage(back.prop, np.array((0.4, 2.0)))
    assert ways[0].push and not ways[1].push
    assert abs(wrap_angle(there.heading - math.pi)) < 1e-5 and abs(back.heading) < 1e-5


def test_hinge_and_handle_points_show_the_guess_and_win():
    scene, leaf = bpy.context.scene, door((1.0, 0.0, 0.0))
    hinge = show_goal_point(GoalSpec("open", leaf), scene, WorldFrame(), START)
    assert points_of(leaf)[0] == hinge and hinge.name == "NSM Hinge Door" and hinge.parent == leaf
    handle = points_of(leaf)[1]
    assert handle.name == "NSM Handle Door"
    np.testing.assert_allclose(handle.matrix_world.translation, (1 + LEAF[0] - 0.06, 0, 1.015), atol=1e-3)
    before = opening(leaf).prop
    show_goal_point(GoalSpec("open", leaf), scene, WorldFrame(), START)
    assert len([o for o in scene.objects if o.type == "EMPTY"]) == 2
    handle.location.z += 0.1
    hinge[SWING] = -int(before.swing)
    after = opening(leaf).prop
    np.testing.assert_allclose(after.handle - before.handle, (0, 0, 0.1), atol=1e-4)
    assert after.swing == -before.swing
    handle.location.x -= LEAF[0] - 0.2
    hinge.location.x += LEAF[0]
    turned = opening(leaf).prop
    np.testing.assert_allclose(turned.pose[:2], (1 + LEAF[0], 0), atol=1e-4)
    assert abs(wrap_angle(turned.closed - math.pi)) < 1e-4


def test_a_scaled_character_sees_a_scaled_door():
    leaf = door()
    leaf.scale = (0.5, 0.5, 0.5)
    leaf.location = (1.0, 0.0, 0.3)
    prop = opening(leaf, WorldFrame(scale=0.5, floor=0.3)).prop
    assert prop.width == pytest.approx(LEAF[0], abs=1e-3) and prop.handle[2] == pytest.approx(1.015, abs=1e-3)
    np.testing.assert_allclose(prop.pose[:3], (2, 0, 0), atol=1e-4)


def test_a_mirrored_leaf():
    leaf = door()
    leaf.scale.x = -1
    prop = opening(leaf).prop
    np.testing.assert_allclose(prop.to_world(prop.handle)[:2], (-LEAF[0] + 0.06, 0), atol=1e-3)


class TestWhatCannotBeOpened:
    def test_things_that_are_no_leaf(self):
        for name, low, high in (
            ("Cube", (0, 0, 0), (1, 1, 2)),
            ("Plank", (0, 0, 0), (1, 0.05, 0.3)),
            ("Gate", (0, 0, 0), (3, 0.1, 2)),
        ):
            with pytest.raises(GoalError, match=f"{name} measures .* is no leaf of a door"):
                opening(box(name, low, high))

    def test_a_leaf_upstairs(self):
        with pytest.raises(GoalError, match="does not stand on the character's floor"):
            opening(door((0, 0, 2.6)))

    def test_an_empty_without_a_leaf(self):
        with pytest.raises(GeometryError, match="Nothing"):
            opening(empty("Nothing", (0, 0, 0)))

    def test_a_handle_off_the_leaf(self):
        leaf = door()
        show_goal_point(GoalSpec("open", leaf), bpy.context.scene, WorldFrame(), START)
        points_of(leaf)[1].location.x += 0.5
        with pytest.raises(GoalError, match="handle of Door is not on its leaf"):
            opening(leaf)

    def test_a_door_that_was_rotated_to_lie_down(self):
        leaf = door(handle=False)
        leaf.matrix_world = Matrix.Rotation(math.pi / 2, 4, "X")
        with pytest.raises(GoalError, match="no leaf"):
            opening(leaf)
