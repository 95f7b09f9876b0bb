"""What is no door to be swung open: each kind gets a sentence that says what was found, and ordinary doors
get none.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from door_trials import pair
from mathutils import Matrix
from scenes import LEAF, box, door, mesh_of_boxes

from nsm_blender.goals.resolve import resolve, show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import TakeSpec, finish, generate, prepare
from nsm_blender.world.frame import WorldFrame
from nsm_core.errors import GoalError
from nsm_core.world.scene.containers import Front

START = (np.array((0.4, -2.0), np.float32), math.pi)
W, T, H = LEAF


def opening(leaf):
    bpy.context.view_layer.update()
    return resolve(GoalSpec("open", leaf), bpy.context.scene, WorldFrame(), START).prop


def refused(leaf, sentence):
    with pytest.raises(GoalError, match=sentence) as told:
        opening(leaf)
    assert str(told.value).count(leaf.name) and str(told.value).endswith(".")


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("SlidingDoor", "slides"),
        ("sliding_door.001", "slides"),
        ("sweethome3d_opening_on_rail_1_door", "slides"),
        ("Bifold Door", "folds"),
        ("Roller Shutters", "rolls"),
        ("revolving-door", "revolves"),
        ("Roof Hatch", "is a hatch"),
    ],
)
def test_a_name_tells_unless_the_animator_gives_it_a_hinge(name, how):
    leaf = door(name=name)
    refused(leaf, f"{leaf.name} {how}.*only a leaf that swings.*Show Goal Points")
    show_goal_point(GoalSpec("open", leaf), bpy.context.scene, WorldFrame(), START, told=[])
    assert opening(leaf).width > 0.7


@pytest.mark.parametrize(
    "name",
    ["Handrail door", "Landslide Lodge Door", "Closet Door", "Door.Slate", "Oven Room Door", "Outside Door"],
)
def test_words_within_words_and_rooms_named_like_furniture_tell_nothing(name):
    opening(door(name=name))


def test_keys_tell():
    leaf = door()
    for frame, x in ((1, 0.0), (20, 0.8)):
        leaf.location.x = x
        leaf.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(1)
    refused(leaf, "Door slides, by its keys")
    leaf.animation_data_clear()
    for frame, tilt in ((1, 0.0), (20, 1.4)):
        leaf.rotation_euler.x = tilt
        leaf.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)
    refused(leaf, "Door tilts, by its keys")
    leaf.animation_data_clear()
    for frame, turn in ((1, 0.0), (20, 1.4)):
        leaf.rotation_euler = 0, 0, turn
        leaf.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)
    opening(leaf)


def test_constraints_and_drivers_tell_before_they_are_found_in_the_way():
    leaf, character = door(), add_character((0.9, -2.0, 0.0))
    rail = leaf.constraints.new("LIMIT_LOCATION")
    rail.name, rail.use_min_x, rail.use_max_x, rail.min_x, rail.max_x = "Rail", True, True, 0.0, 0.8
    with pytest.raises(GoalError, match="Door slides, by its constraint Rail; only a leaf that swings"):
        finish(prepare(TakeSpec(character, [GoalSpec("open", leaf)]), bpy.context.scene))
    leaf.constraints.remove(rail)
    leaf.driver_add("location", 0).driver.expression = "frame / 100"
    refused(leaf, "Door slides, by its drivers")


def test_one_that_hangs_before_another_and_overlaps_it_slides():
    parts = [((0, -0.01, 0), (0.85, 0.01, 2.0))]
    front, back = mesh_of_boxes("Front", parts), mesh_of_boxes("Back", parts, (0.8, 0.035, 0))
    refused(front, "Front hangs before Back and overlaps it, as doors that slide do")
    refused(back, "Back hangs before Front")
    back.location.y = 0.0  # leaves of a double door meet in one plane, rebated
    opening(front)


class TestFurniture:
    def cupboard(self, low=0.1, high=1.9, wide=0.8, name="Wardrobe"):
        """A body of 0.6 m with a door in front of it."""
        t, back = 0.02, 0.6
        sides = [((x, 0, 0), (x + t, back, 2.0)) for x in (-t, wide)]
        body = mesh_of_boxes(
            name,
            [
                *sides,
                ((-t, back, 0), (wide + t, back + t, 2.0)),
                ((-t, 0, 0), (wide + t, back, low)),
                ((-t, 0, high), (wide + t, back, 2.0)),
                ((0, 0.05, 1.0), (wide, back, 1.02)),
            ],
        )
        leaf = mesh_of_boxes("Door", [((0, -t, low), (wide, 0, high))])
        return body, leaf

    def test_a_cupboard_is_too_shallow_to_walk_into(self):
        refused(
            self.cupboard()[1],
            "Door is the door of a cupboard: what is behind it ends after 0.5[0-9] m, too soon to walk in",
        )

    def test_one_that_is_parented_to_its_furniture_is_opened_by_a_hand(self):
        body, leaf = self.cupboard(wide=0.6, name="Kitchen Fridge")
        refused(leaf, "parent it to the furniture that it is a part of, and a hand opens it")
        leaf.parent = body
        front = opening(leaf)
        assert isinstance(front, Front) and front.part.kind == "hinged"

    def test_one_that_is_wider_than_an_arm_swings_is_told(self):
        body, leaf = self.cupboard(wide=0.9, name="Kitchen Fridge")
        leaf.parent = body
        refused(leaf, "Door is too wide, or goes too far, for a hand of one who stays where one stands")

    def test_its_flaps_and_drawers(self):
        refused(
            box("FridgeDoor", (0, -0.02, 1.3), (0.7, 0, 1.8)),
            "FridgeDoor measures .*: it is the door of a fridge",
        )
        refused(box("top_drawer", (0, -0.02, 0.3), (0.7, 0.4, 0.5)), "top_drawer measures .*: it is a drawer")
        refused(
            box("Flap", (0, -0.02, 0.1), (0.7, 0, 0.8)), "Flap measures .*: it is low, as a cupboard's door"
        )

    def test_a_wall_at_some_way_or_furniture_before_a_door_is_no_cupboard(self):
        leaf = door()
        box("Opposite", (-2, 0.7, 0), (3, 0.8, 2.5))
        opening(leaf)
        box("Shelf", (0.1, 0.2, 0), (0.7, 0.5, 1.8))
        opening(leaf)


def test_a_leaf_before_a_wall_without_an_opening():
    leaf = mesh_of_boxes("Door", [((0, -0.02, 0), (W, 0.02, H))], (0, -0.1, 0))
    box("Wall", (-2, -0.07, 0), (3, 0.07, 2.5))
    refused(leaf, "Behind Door, 0.0[0-9] m off, is something solid that leaves no way through")


def test_what_lies_flat_is_a_hatch():
    leaf = door(handle=False)
    leaf.matrix_world = Matrix.Rotation(math.pi / 2, 4, "X")
    refused(leaf, "Door measures .*: it lies flat, as a hatch or a lid does")


def test_leaves_of_a_double_door_too_narrow_for_one_to_pass():
    left, right = pair()
    assert opening(left).width > 0.75
    for leaf, x in ((left, 0.2), (right, 0.605)):
        leaf.scale.x, leaf.location.x = 0.5, x
    refused(
        left,
        "Left measures 0.40 .*: it is too narrow to walk through while the other leaf of this double door "
        "stays shut",
    )
    bpy.data.objects.remove(right)
    refused(left, "Left measures 0.40 .*: it is too narrow to walk through\\.")


def test_a_leaf_that_cannot_open_is_told_before_the_take_begins():
    leaf, character = door(handle=True), add_character((0.9, -2.0, 0.0))
    for y in (-0.5, 0.5):
        box(f"Crate {y}", (0.2, y - 0.4, 0.0), (0.8, y + 0.4, 0.5))
    with pytest.raises(GoalError, match="Door opens by only .* degrees before it meets what stands about it"):
        finish(generate(TakeSpec(character, [GoalSpec("open", leaf)]), bpy.context.scene))
