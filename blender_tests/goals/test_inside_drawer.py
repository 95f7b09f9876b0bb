"""What blocks a thing in a drawer that is opened for it is put aside, and the rest of what is in it stays."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from placings import found, place
from scenes import mesh_of_boxes

from nsm_blender.demo_scene.kitchen import build_kitchen
from nsm_blender.rigs.character import add_character
from nsm_core.world.scene.props import LightThing

TOP = "Drawers drawer 1"
INSIDE = np.array((1.57, -0.34, 0.7))  # on its floor
CLIP = (0.14, -0.05)  # metres beside the pot
BOOK = ((-0.016, -0.115, 0.0), (0.016, 0.115, 0.12))


@pytest.fixture
def character(empty_scene):
    """Who is in a kitchen, in whose topmost drawer a pot stands between two books, and a clip beside them."""
    room, _ = build_kitchen(0)
    bpy.data.objects.remove(bpy.data.objects["Plate"])
    mesh_of_boxes("Pot", [((-0.02, -0.02, 0.0), (0.02, 0.02, 0.05))], INSIDE)
    for name, aside in (("Red Book", -0.042), ("Blue Book", 0.042)):
        mesh_of_boxes(name, [BOOK], INSIDE + (aside, 0.0, 0.0))
    mesh_of_boxes("Clip", [((-0.015, -0.015, 0.0), (0.015, 0.015, 0.03))], INSIDE + (*CLIP, 0.0))
    character = add_character((*room.start, 0.0))
    bpy.context.view_layer.update()
    return character


def test_what_blocks_a_thing_in_a_drawer_is_put_aside_and_the_rest_stays_in_it(character):
    (goal,) = found(character, place("Pot"))
    opened, *aside, _, shut = goal.parts
    assert (opened.name, shut.name, shut.opening) == (TOP, TOP, 0.0)
    assert aside and {one.name for one in aside} <= {"Red Book", "Blue Book"}
    front, end = opened.prop, opened.pulling.end
    out = front.at(end).pose - front.pose
    assert np.linalg.norm(out) > 0.2
    for one in (*aside, goal):  # planned for where the drawer brings them, and moved from where they are
        assert isinstance(one.prop, LightThing)
        np.testing.assert_allclose(one.picking.at[:3] - one.prop.pose[:3], out[:3], atol=1e-4)
        assert not front.at(end).carries(one.picking.pose)
    stays, goes = (INSIDE + (x, y, 0.02) for x, y in (CLIP, (0.0, 0.0)))
    solid = front.signed_distance(np.array((stays, goes), np.float32), 0.2)
    assert solid[0] < 0 < solid[1]
