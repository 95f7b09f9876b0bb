"""Small scenes that several tests share."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_blender.demo_scene.room import place
from nsm_core.world.scene.furniture import Furniture, make


def furnish(
    kind: str = "chair",
    name: str = "Chair",
    position: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
    seed: int = 90001,
    **measures,
) -> tuple[bpy.types.Object, Furniture]:
    """Put a piece of furniture of the parametric set, from a seed that training never draws, into the
    scene.
    """
    piece = make(kind, np.random.default_rng(seed), **measures)
    made = place(piece, name, position, heading, "Oak", "Teal")
    bpy.context.view_layer.update()
    return made, piece


def box(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> bpy.types.Object:
    """Put a box with world corners ``low`` and ``high`` into the scene."""
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(
        corners, [], [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    )
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.update()
    return made


def empty(name: str, location: tuple[float, float, float], turn: float = 0.0) -> bpy.types.Object:
    """Put an empty into the scene."""
    made = bpy.data.objects.new(name, None)
    made.location, made.rotation_euler = location, (0, 0, turn)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.update()
    return made


def mesh_of_boxes(
    name: str, boxes: list[tuple[tuple[float, ...], tuple[float, ...]]], location=(0.0, 0.0, 0.0), turn=0.0
):
    """Put an object of several boxes, corners in its own frame, into the scene; its origin is at
    ``location``, turned about Z.
    """
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    vertices, faces = [], []
    for low, high in boxes:
        faces += [tuple(len(vertices) + i for i in quad) for quad in quads]
        vertices += [
            (x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])
        ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    made = bpy.data.objects.new(name, mesh)
    made.location, made.rotation_euler = location, (0, 0, turn)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.update()
    return made


LEAF, FRAME_DEPTH = (0.85, 0.04, 2.05), 0.14


def door(location=(0.0, 0.0, 0.0), turn=0.0, handle=True, origin="hinge", aside=0.0, name="Door"):
    """A leaf of 0.85 m, its hinge at ``location``, free edge along +X turned by ``turn``, in a wall with
    jambs.

    ``aside`` moves it off the middle of the wall, along its +Y.
    """
    w, t, h = LEAF
    boxes = [((0, -t / 2, 0.005), (w, t / 2, h))]
    if handle:
        boxes += [
            ((w - 0.14, side * 0.05 - 0.015, 1.0), (w - 0.02, side * 0.05 + 0.015, 1.03)) for side in (-1, 1)
        ]
    if origin != "hinge":
        boxes = [
            (tuple(np.subtract(a, (w / 2, 0, h / 2))), tuple(np.subtract(b, (w / 2, 0, h / 2))))
            for a, b in boxes
        ]
    leaf = mesh_of_boxes(name, boxes)
    c, s = np.cos(turn), np.sin(turn)
    leaf.location, leaf.rotation_euler.z = location, turn
    if origin != "hinge":
        leaf.location = np.array(location) + (c * w / 2, s * w / 2, h / 2)
    d = FRAME_DEPTH / 2
    walls = [
        ((-1.5, -d - aside, 0), (-0.01, d - aside, 2.5)),
        ((w + 0.01, -d - aside, 0), (w + 1.5, d - aside, 2.5)),
    ]
    mesh_of_boxes(
        "Wall", [*walls, ((-0.01, -d - aside, h + 0.02), (w + 0.01, d - aside, 2.5))], location, turn
    )
    bpy.context.view_layer.update()
    return leaf
