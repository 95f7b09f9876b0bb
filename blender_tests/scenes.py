"""Small scenes that several tests share."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_blender.room import place
from nsm_core.furniture import Furniture, make


def furnish(
    kind: str = "chair",
    name: str = "Chair",
    position: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
    seed: int = 90001,
    **measures,
) -> tuple[bpy.types.Object, Furniture]:
    """Put a piece of furniture of the parametric set, from a seed that training never draws, into the scene."""
    piece = make(kind, np.random.default_rng(seed), **measures)
    made = place(piece, name, position, heading, "Oak", "Teal")
    bpy.context.view_layer.update()
    return made, piece


def box(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> bpy.types.Object:
    """Put a box with world corners ``low`` and ``high`` into the scene."""
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
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
