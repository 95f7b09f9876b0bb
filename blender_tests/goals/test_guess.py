"""The action of an object that is added: by its shape, and by its name where the shape allows several."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scenes import box, door, empty, furnish, mesh_of_boxes

import nsm_blender
from nsm_blender.goals.guess import asked_of, guess
from nsm_blender.world.frame import WorldFrame
from nsm_core.world.scene.furniture import KINDS, SEAT_KINDS

OTHERS = {"box": "carry", "crate": "carry", "step": "climb", "low_wall": "climb"}


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "wall"])
def test_the_shape_tells_where_the_name_does_not(kind):
    expected = "sit" if kind in SEAT_KINDS else OTHERS.get(kind, "walk")
    thing, _ = furnish(kind, "Thing", (1.0, 2.0), 0.7)
    assert guess(thing, WorldFrame()) == expected


def test_a_leaf_is_opened_and_a_wall_is_not():
    assert guess(door((1, 2, 0), 0.4, name="Thing"), WorldFrame()) == "open"
    assert guess(box("Thing", (-3, 0, 0), (3, 0.1, 2.5)), WorldFrame()) == "walk"


def test_names_decide_between_what_is_possible():
    frame = WorldFrame()
    cube = box("Crate", (0, 0, 0), (0.45, 0.45, 0.42))
    assert guess(cube, frame) == "carry"
    cube.name = "PoufLarge.001"
    assert guess(cube, frame) == "sit"
    tall = box("Chair", (0, 0, 0), (0.9, 0.3, 1.8))
    assert guess(tall, frame) == "walk", "nobody sits on that"
    table = box("Low Table", (0, 0, 0.4), (1.05, 0.46, 0.44))
    assert guess(table, frame) == "walk"
    table.name = "Thing"
    assert guess(table, frame) == "sit"


def test_the_size_is_the_characters():
    crate = box("Thing", (0, 0, 0), (45, 45, 42))
    assert guess(crate, WorldFrame(scale=100.0)) == "carry" and guess(crate, WorldFrame()) == "walk"
    assert guess(empty("Mark", (0, 0, 0)), WorldFrame()) == "walk"
    broken = box("Thing", (0, 0, 0), (0.4, 0.4, 0.4))
    broken.data.vertices[0].co.x = np.nan
    assert guess(broken, WorldFrame()) == "walk"


def loose_chair():
    legs = [
        box(f"Leg {x}{y}", (x, y, 0), (x + 0.04, y + 0.04, 0.42)) for x in (-0.2, 0.16) for y in (-0.2, 0.16)
    ]
    seat = box("Seat Board", (-0.22, -0.22, 0.42), (0.22, 0.22, 0.46))
    return seat, [*legs, box("Back", (-0.22, 0.19, 0.46), (0.22, 0.22, 0.95))]


def test_parts_are_no_goals_beside_their_whole():
    seat, parts = loose_chair()
    table = box("Desk", (2, 0, 0.7), (3.2, 0.7, 0.74))
    asked = asked_of([*parts, seat, table], WorldFrame())
    assert [(a.target, a.action) for a in asked] == [(seat, "sit"), (table, "walk")]
    whole = empty("Chair", (0, 0, 0))
    for part in (*parts, seat):
        part.parent = whole
    bpy.context.view_layer.update()
    asked = asked_of([*parts, seat, whole], WorldFrame())
    assert [(a.target, a.action) for a in asked] == [(whole, "sit")]


def test_a_box_selected_with_a_table_goes_onto_it():
    nsm_blender.register()
    try:
        crate = box("Thing", (0, 0, 0), (0.3, 0.3, 0.3))
        table = mesh_of_boxes("Table", [((0, 0, 0.7), (1.2, 0.7, 0.74))], (2, 0, 0))
        for each in (crate, table):
            each.select_set(True)
        bpy.context.view_layer.objects.active = table
        bpy.ops.nsm.goal_add()
        (row,) = bpy.context.scene.nsm.goals
        assert (row.object, row.action, row.destination) == (crate, "carry", table)
    finally:
        nsm_blender.unregister()
