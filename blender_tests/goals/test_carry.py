"""Boxes to carry: what hands can hold, and where on a top, or at an empty, a box is set down."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scenes import box, empty, furnish, mesh_of_boxes

from nsm_blender.goals.resolve import place_after, resolve, show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.surroundings import Surroundings
from nsm_core.distances import BODY_TO_BOX
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import heading_to_direction, rotate_planar, wrap_angle
from nsm_core.world.affordances.standing import BODY_TO_EDGE
from nsm_core.world.scene.props import Box

START = (np.array((0.0, -2.0), np.float32), math.pi)


def crate(location=(0.0, 0.0, 0.0), size=(0.4, 0.3, 0.25), turn=0.0, name="Box"):
    half = np.array(size) * (0.5, 0.5, 1)
    return mesh_of_boxes(name, [((-half[0], -half[1], 0), tuple(half))], location, turn)


def carry(target, to, frame=None, around=None, start=START):
    bpy.context.view_layer.update()
    return resolve(GoalSpec("carry", target, to=to), bpy.context.scene, frame or WorldFrame(), start, around)


def table(location=(3.0, 0.0), turn=0.0, size=(1.2, 0.7), height=0.7, name="Table"):
    return box_table(name, location, turn, size, height)


def box_table(name, location, turn, size, height):
    x, y = size[0] / 2, size[1] / 2
    legs = [
        (
            (sx * x - 0.05 * (sx > 0), sy * y - 0.05 * (sy > 0), 0),
            (sx * x + 0.05 * (sx < 0), sy * y + 0.05 * (sy < 0), height),
        )
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    return mesh_of_boxes(name, [*legs, ((-x, -y, height - 0.04), (x, y, height))], (*location, 0), turn)


def in_table(goal, to):
    """The goal's place and facing direction in the destination's own frame."""
    matrix = np.array(to.matrix_world.inverted())
    place = matrix @ np.append(goal.position, 1)
    direction = matrix[:2, :2] @ heading_to_direction(np.array(goal.heading))
    return place[:3], direction


@pytest.mark.parametrize("turn", [0.0, 0.6, 2.2])
def test_a_box_is_read_in_a_frame_at_its_own_centre(turn):
    goal = carry(crate((1.0, 0.5, 0.0), turn=turn), empty("Here", (2, 2, 0)))
    prop = goal.prop
    assert isinstance(prop, Box) and prop.name == "Box"
    np.testing.assert_allclose(prop.size, (0.4, 0.3, 0.25), atol=1e-5)
    np.testing.assert_allclose(prop.pose[:3], (1.0, 0.5, 0.125), atol=1e-5)
    assert abs(wrap_angle(prop.pose[3] - turn)) < 1e-5
    inside, outside = prop.query.signed_distance(np.array(((0, 0, 0), (0.25, 0, 0)), np.float32), 0.3)
    assert inside < 0 and outside == pytest.approx(0.05, abs=1e-4)
    assert prop.volume.heading == 0 and prop.volume.occupancy.mean() > 0.9
    np.testing.assert_allclose(prop.sensed().centre, prop.pose[:3], atol=1e-5)


def test_a_box_weighs_as_its_size_says_or_as_told():
    target, there = crate(), empty("There", (2.0, 1.0, 0.4))
    assert carry(target, there).prop.mass == pytest.approx(150 * 0.4 * 0.3 * 0.25, rel=0.01)
    asked = GoalSpec("carry", target, to=there, mass=12.5)
    assert resolve(asked, bpy.context.scene, WorldFrame(), START).prop.mass == 12.5


def test_a_box_with_children_a_turn_applied_to_its_mesh_and_a_tilt_is_read_upright():
    target = crate()
    target.data.transform(Matrix.Rotation(0.5, 4, "Z"))
    lid = crate((0, 0, 0.25), (0.2, 0.2, 0.05), name="Lid")
    lid.parent = target
    prop = carry(target, empty("Here", (2, 2, 0))).prop
    np.testing.assert_allclose(sorted(prop.size), (0.3, 0.3, 0.4), atol=0.01)
    assert (
        abs(wrap_angle(2 * (prop.pose[3] - 0.5))) < 0.02
        or abs(wrap_angle(2 * (prop.pose[3] - 0.5 - math.pi / 2))) < 0.02
    )


@pytest.mark.parametrize(("turn", "facing"), [(0.0, None), (0.5, None)])
def test_a_box_is_set_behind_the_edge_that_is_nearest(turn, facing):
    to = table((0.0, 3.0), turn)
    around = Surroundings(bpy.context.scene, WorldFrame())
    goal = carry(crate(), to, around=around)  # the box stands at the origin, the table beyond it
    place, direction = in_table(goal, to)
    assert goal.position[2] == pytest.approx(0.7 + 0.125, abs=0.003)
    assert direction @ np.array((0, 1)) > 0.99  # it faces the table's far side, perpendicular to the edge
    near_face = place[1] - 0.3 / 2
    assert -0.35 + 0.02 < near_face < -0.35 + 0.07
    assert abs(place[0]) < 0.4
    off = max(BODY_TO_BOX, near_face + 0.35 + BODY_TO_EDGE)
    stand = goal.position[:2] - (0.15 + off) * heading_to_direction(np.array(goal.heading))
    assert np.linalg.norm(stand) < np.linalg.norm(goal.position[:2])
    np.testing.assert_allclose(place_after(goal, START, around)[0], stand, atol=2e-3)


def test_what_stands_on_the_top_is_left_standing():
    to = table((0.0, 3.0))
    box("Vase", (-0.35, 2.7, 0.7), (0.2, 2.85, 1.0))  # in the middle of the near edge
    place, direction = in_table(carry(crate(), to), to)
    half = (0.2, 0.15) if abs(direction[1]) > 0.5 else (0.15, 0.2)
    apart = np.maximum(np.abs(place[:2] - (-0.075, -0.225)) - half, 0) - np.array((0.275, 0.075))
    assert apart.max() > 0


def test_a_side_without_room_to_stand_is_not_taken():
    to = table((0.0, 3.0))
    box("Cupboard", (-1.5, 1.6, 0.0), (1.5, 2.3, 1.8))  # 35 cm before the near edge
    place, direction = in_table(carry(crate(), to), to)
    assert direction @ np.array((0, 1)) < 0.5


def test_two_boxes_do_not_go_to_the_same_place():
    to, first, second = table((0.0, 3.0)), crate((0.5, 0, 0), name="A"), crate((-0.5, 0, 0), name="B")
    around = Surroundings(bpy.context.scene, WorldFrame(), moving=[first, second])
    a, b = carry(first, to, around=around), carry(second, to, around=around)
    apart = rotate_planar(a.position[:2] - b.position[:2], -np.float32(a.heading))
    assert abs(apart[0]) > 0.4 or abs(apart[1]) > 0.3


def test_the_same_box_twice_is_one_prop_that_leaves_from_its_first_destination():
    first, second, target = table((0.0, 3.0), name="First"), table((6.0, 3.0), name="Second"), crate()
    around = Surroundings(bpy.context.scene, WorldFrame(), moving=[target])
    a, b = carry(target, first, around=around), carry(target, second, around=around)
    assert a.prop is b.prop
    assert b.position[0] < 6.0 - 0.2  # the side that looks to the first table
    with pytest.raises(GoalError, match="moved earlier"):
        carry(crate((0, 1, 0), name="Other"), target, around=around)


def test_an_empty_marks_where_the_base_goes_and_how_one_stands():
    goal = carry(crate(), empty("Here", (2.0, 1.0, 0.4), 0.8))
    np.testing.assert_allclose(goal.position, (2.0, 1.0, 0.525), atol=1e-5)
    assert goal.heading == pytest.approx(0.8, abs=1e-6)


def test_a_scaled_character_carries_in_its_own_units():
    frame = WorldFrame(scale=0.5, floor=0.2)
    goal = carry(crate((1.0, 0.0, 0.2), (0.2, 0.15, 0.12)), empty("Here", (1.0, 1.0, 0.3)), frame)
    np.testing.assert_allclose(goal.prop.size, (0.4, 0.3, 0.24), atol=1e-5)
    np.testing.assert_allclose(goal.position, (2.0, 2.0, 0.2 + 0.12), atol=1e-5)


def test_the_goal_point_of_a_destination_shows_it_and_wins():
    scene, to, target = bpy.context.scene, table((0.0, 3.0)), crate()
    before = carry(target, to)
    spec = GoalSpec("carry", target, to=to)
    point = show_goal_point(spec, scene, WorldFrame(), START)
    assert point.parent == to and point.name == "NSM Goal Box"
    np.testing.assert_allclose(point.matrix_world.translation, before.position - (0, 0, 0.125), atol=1e-4)
    assert show_goal_point(spec, scene, WorldFrame(), START) == point
    point.location.x += 0.2
    after = carry(target, to)
    np.testing.assert_allclose(after.position - before.position, (0.2, 0, 0), atol=1e-4)
    other = table((5.0, 3.0), name="Other")
    # The point is of the one destination only.
    assert np.linalg.norm(carry(target, other).position[:2] - (5, 3)) < 1


def test_furniture_of_the_parametric_set_takes_a_box():
    for kind, x in (("table", 0.0), ("desk", 4.0), ("bench", 8.0)):
        to, piece = furnish(kind, kind.capitalize(), (x, 3.0))
        goal = carry(crate(size=(0.3, 0.25, 0.2)), to)
        assert goal.position[2] > 0.45 and np.linalg.norm(goal.position[:2] - (x, 3)) < max(piece.size)


def test_a_box_can_be_set_on_a_floor_wider_than_what_is_looked_at():
    ground = box("Ground", (-6, -8, -0.1), (12, 8, 0.0))
    goal = carry(crate(), ground)
    assert goal.position[2] == pytest.approx(0.125, abs=0.01) and np.linalg.norm(goal.position[:2]) < 4


class TestWhatCannotBeCarried:
    @pytest.mark.parametrize(
        ("where", "size", "words"),
        [
            ((0, 0, 0), (0.8, 0.3, 0.3), "two hands hold"),
            ((0, 0, 0), (0.3, 0.3, 1.1), "two hands hold"),
            ((0, 0, 1.5), (0.3, 0.3, 0.3), "put it lower"),
            ((0, 0, -0.4), (0.3, 0.3, 0.3), "below the character's floor"),
        ],
    )
    def test_boxes(self, where, size, words):
        with pytest.raises(GoalError, match=words):
            carry(crate(where, size), empty("Here", (2, 2, 0)))

    def test_no_destination(self):
        with pytest.raises(GoalError, match="Box has no destination; choose"):
            carry(crate(), None)

    def test_a_destination_that_is_gone(self):
        gone = table()
        bpy.context.scene.collection.objects.unlink(gone)
        with pytest.raises(GoalError, match="destination Table is no longer"):
            carry(crate(), gone)

    def test_itself(self):
        target = crate()
        with pytest.raises(GoalError, match="on itself"):
            carry(target, target)

    def test_a_top_that_is_too_high_too_small_or_none(self):
        with pytest.raises(GoalError, match="top of High is 1.60 m"):
            carry(crate(), table((0, 3), height=1.6, name="High"))
        with pytest.raises(GoalError, match="top of Small is too small"):
            carry(crate(), table((0, 3), size=(0.3, 0.3), name="Small"))
        ramp = bpy.data.meshes.new("Ramp")
        ramp.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 1.2), (-1, 1, 1.2)], [], [(0, 1, 2, 3)])
        ramp = bpy.data.objects.new("Ramp", ramp)
        ramp.location = (0, 6, 0)
        bpy.context.scene.collection.objects.link(ramp)
        with pytest.raises((GoalError, GeometryError), match="Ramp"):
            carry(crate(), ramp)

    def test_a_top_that_is_full(self):
        to = table((0, 3))
        box("Model Railway", (-0.55, 2.7, 0.7), (0.55, 3.3, 0.8))
        with pytest.raises(GoalError, match="no free place for Box .* on Table"):
            carry(crate(), to)

    def test_an_empty_out_of_reach(self):
        with pytest.raises(GoalError, match="Here is 1.70 m over"):
            carry(crate(), empty("Here", (2, 2, 1.7)))
