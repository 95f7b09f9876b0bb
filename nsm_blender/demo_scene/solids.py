"""What furniture and props of the demonstration are made of: boxes, and parts of lofts as objects."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..rigs.mannequin.loft import LoftPart
from ..rigs.mannequin.loft_mesh import loft_mesh

_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def boxes(mins: Array, maxs: Array) -> tuple[Array, list[tuple[int, ...]]]:
    """Vertices (8 N, 3) and faces (6 N) of boxes between corners ``mins`` and ``maxs`` (N, 3)."""
    mins, maxs = np.atleast_2d(mins), np.atleast_2d(maxs)
    vertices = np.where(_CORNERS[None] == 1, maxs[:, None], mins[:, None]).reshape(-1, 3)
    return vertices, [tuple(8 * k + i for i in quad) for k in range(len(mins)) for quad in _QUADS]


def block(low: tuple[float, float, float], high: tuple[float, float, float], tone: int) -> LoftPart:
    """A box between two corners as a part of an object."""
    return LoftPart(*boxes(np.array(low), np.array(high)), tone)


def add_parts(
    name: str,
    parts: Sequence[LoftPart],
    materials: Sequence[bpy.types.Material],
    location: tuple[float, float, float],
    turn: float = 0.0,
    smooth: bool = True,
) -> bpy.types.Object:
    """Add an object of ``parts`` to the open scene: ``location`` metres, ``turn`` radians about Z."""
    made = link(bpy.data.objects.new(name, loft_mesh(name, parts, materials, smooth)))
    made.location, made.rotation_euler = location, (0, 0, turn)
    return made


def link(made: bpy.types.Object) -> bpy.types.Object:
    """Put an object into the open scene; returns it."""
    bpy.context.scene.collection.objects.link(made)
    return made
