"""Places to walk to, furniture in loose parts, and goal points where none was found."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from scenes import box, empty, furnish, mesh_of_boxes

from nsm_blender.goals.points import goal_point_of
from nsm_blender.goals.resolve import resolve, show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.world.frame import WorldFrame
from nsm_core.errors import GoalError, NsmError
from nsm_core.rotations import heading_to_direction

START = (np.array((0.0, -4.0), np.float32), math.pi)


def goal(action, target=None, start=START, **more):
    bpy.context.view_layer.update()
    return resolve(GoalSpec(action, target, **more), bpy.context.scene, WorldFrame(), start)


def refused(action, target=None, **more) -> str:
    with pytest.raises(NsmError) as caught:
        goal(action, target, **more)
    return str(caught.value)


def shown(spec) -> tuple[bpy.types.Object, str]:
    told: list[str] = []
    point = show_goal_point(spec, bpy.context.scene, WorldFrame(), START, told=told)
    return point, " ".join(told)


class TestWhereOneStands:
    def test_inside_furniture_is_refused_by_its_name(self):
        furnish("sofa", "Sofa", (0.0, 0.0))
        furnish("table", "Table", (3.0, 0.0))
        assert "inside Sofa" in refused("walk", empty("Mark", (0.0, 0.0, 0.0)))
        assert "inside Table" in refused("walk", location=(3.0, 0.0, 0.0))
        assert goal("walk", location=(1.8, 0.0, 0.0)).action == "walk"

    def test_in_the_air_and_under_the_floor_are_told(self):
        assert "hangs 1.50 m over the floor" in refused("walk", empty("Mark", (2.0, 0.0, 1.5)))
        box("Podium", (-1, -1, 0), (1, 1, 0.3))
        assert "0.50 m over Podium" in refused("walk", empty("Above", (0.0, 0.0, 0.8)))
        assert "0.60 m under" in refused("run", location=(4.0, 0.0, -0.6))
        assert goal("walk", location=(4.0, 0.0, 0.05)).position[2] == 0

    def test_a_place_on_a_podium_is_climbed_to(self):
        box("Podium", (-1, -1, 0), (1, 1, 0.3))
        found = goal("walk", empty("Mark", (0.4, 0.1, 0.3)))
        assert found.action == "climb" and found.name == "Mark" and found.interaction is not None
        np.testing.assert_allclose(found.position, (0.4, 0.1, 0.3), atol=0.03)
        np.testing.assert_allclose(heading_to_direction(np.array(found.heading)), (0, 1), atol=1e-6)
        assert "inside Podium" in refused("walk", location=(0.0, 0.0, 0.0))

    def test_what_is_too_high_is_refused(self):
        box("Gallery", (-2, -2, 2.6), (2, 2, 2.8))
        assert "2.80 m over the character's floor, on Gallery" in refused("walk", location=(0.0, 0.0, 2.8))
        assert goal("walk", location=(0.0, 0.0, 0.0)).action == "walk"

    def test_before_an_object_one_stands_where_there_is_room(self):
        chair, _ = furnish("chair", "Chair", (0.0, 0.0))
        before = goal("walk", chair)
        assert before.position[1] < -0.5
        box("Wall", (-3, -1.3, 0), (3, -0.3, 2))
        beside = goal("walk", chair, start=(np.array((3.0, 3.0), np.float32), 0.0))
        assert abs(beside.position[0]) > 0.5 and abs(beside.position[1]) < 0.2
        ahead = heading_to_direction(np.array(beside.heading))
        assert float(ahead @ -beside.position[:2]) > 0.4  # it looks at the chair

    def test_a_goal_point_to_sit_at_needs_something_to_sit_on(self):
        chair, _ = furnish("chair", "Chair")
        point = show_goal_point(GoalSpec("sit", chair), bpy.context.scene, WorldFrame(), START)
        point.location.x += 0.08
        assert goal("sit", chair).position[0] == pytest.approx(0.08, abs=0.02)
        point.location.x += 1.0
        assert "hangs in the air" in refused("sit", chair)


LEGS = [((x - 0.02, y - 0.02, 0), (x + 0.02, y + 0.02, 0.4)) for x in (-0.2, 0.2) for y in (-0.2, 0.2)]


def loose_chair(turn: float = 0.0, at=(0.0, 0.0)) -> list[bpy.types.Object]:
    """A chair whose seat, back and legs are objects of their own; its back is at +Y of it."""
    parts = [
        ("Seat", [((-0.22, -0.22, 0.4), (0.22, 0.22, 0.45))]),
        ("Back", [((-0.22, 0.18, 0.45), (0.22, 0.22, 0.95))]),
    ]
    parts += [(f"Leg {i}", [leg]) for i, leg in enumerate(LEGS)]
    return [mesh_of_boxes(name, boxes, (*at, 0.0), turn) for name, boxes in parts]


@pytest.mark.parametrize("turn", [0.0, 2.0])
@pytest.mark.parametrize("chosen", ["Seat", "Back", "Leg 1"])
def test_a_chair_in_loose_parts_is_one_chair(chosen, turn):
    loose_chair(turn, (1.0, 2.0))
    for (
        part
    ) in bpy.data.objects:  # the back tells where the front is, whichever way the parts themselves look
        part.data.transform(part.matrix_world)
        part.matrix_world.identity()
    box("Floor", (-4, -4, -0.1), (4, 4, 0))
    box("Rug", (-1, 0, 0), (3, 4, 0.02))
    box("Table", (1.32, 1.0, 0), (2.5, 3.0, 0.75))
    found = goal("sit", bpy.data.objects[chosen])
    along = heading_to_direction(np.array(found.heading))
    np.testing.assert_allclose(along, heading_to_direction(np.array(turn)), atol=0.02)
    assert np.linalg.norm(found.position[:2] - (1.0, 2.0)) < 0.15 and found.position[2] == pytest.approx(
        0.54, abs=0.02
    )
    assert max(found.interaction.size[:2]) < 0.7 and found.interaction.size[2] == pytest.approx(
        0.95, abs=0.02
    )


def test_what_lies_on_a_seat_raises_it_and_what_stands_on_it_does_not():
    seat = loose_chair()[0]
    assert goal("sit", seat).position[2] == pytest.approx(0.54, abs=0.01)
    cushion = box("Cushion", (-0.21, -0.21, 0.45), (0.21, 0.17, 0.51))
    assert goal("sit", seat).position[2] == pytest.approx(0.60, abs=0.01)
    bpy.data.objects.remove(cushion)
    box("Parcel", (-0.2, -0.2, 0.45), (0.2, 0.15, 0.75))
    assert goal("sit", seat).position[2] == pytest.approx(0.54, abs=0.01)


class TestPointsAreMadeAnyhow:
    def test_where_nothing_can_be_sat_on(self):
        rock = mesh_of_boxes("Rock", [((-0.07, -0.07, 0), (0.07, 0.07, 0.5))], (1.0, 0.0, 0.0))
        assert "sat on" in refused("sit", rock)
        point, told = shown(GoalSpec("sit", rock))
        assert (
            "sat on" in told and "move it" in told and goal_point_of(bpy.context.scene, rock, "sit") == point
        )
        point.location.y += 0.02
        point.rotation_euler.z = 0.5
        found = goal("sit", rock)
        np.testing.assert_allclose(found.position, (1.0, 0.02, 0.59), atol=1e-5)
        assert found.heading == pytest.approx(0.5, abs=1e-5)

    def test_where_nothing_can_be_climbed_or_carried_to(self):
        pole = box("Pole", (-0.05, -0.05, 0), (0.05, 0.05, 0.4))
        parcel = box("Parcel", (2, 2, 0), (2.3, 2.3, 0.3))
        point, told = shown(GoalSpec("climb", pole))
        assert told and point.matrix_world.translation.z == pytest.approx(0.4, abs=1e-5)
        assert goal("climb", pole).position[2] == pytest.approx(0.4, abs=1e-5)
        point, told = shown(GoalSpec("carry", parcel, to=pole))
        assert told and goal("carry", parcel, to=pole).position[2] == pytest.approx(0.4 + 0.15, abs=1e-5)

    def test_a_point_of_no_use_is_shown_again(self):
        chair, _ = furnish("chair", "Chair")
        point, told = shown(GoalSpec("sit", chair))
        assert not told
        point.location.z += 2.0
        again, told = shown(GoalSpec("sit", chair))
        assert again == point and "move the goal point" in told

    def test_where_there_is_no_mesh_at_all_it_is_refused(self):
        with pytest.raises(NsmError, match="no visible faces"):
            shown(GoalSpec("sit", empty("Nothing", (0, 0, 0))))
        with pytest.raises(GoalError, match="no object"):
            shown(GoalSpec("sit"))
