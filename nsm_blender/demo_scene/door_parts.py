"""A door by code: a panelled leaf with hinges and levers, and the frame that it shuts into."""

from __future__ import annotations

import bpy
import numpy as np

from ..rigs.mannequin.loft import LoftPart, loft
from .solids import add_parts, block

Materials = dict[str, bpy.types.Material]

WIDTH, HEIGHT, THICKNESS = 0.86, 2.04, 0.04  # of the leaf, metres
GAP = 0.008  # between the leaf and its frame
HANDLE_HEIGHT, HANDLE_FROM_EDGE = 1.02, 0.065
LINING, CASING, PROUD = 0.03, 0.075, 0.014  # of the frame: inside the opening, on the wall, and off it
OPENING = (-GAP - LINING, WIDTH + GAP + LINING)  # in the wall, x from the hinge


def add_leaf(materials: Materials, name: str, hinge: tuple[float, float], turn: float) -> bpy.types.Object:
    """Add a leaf with its hinge's pin at ``hinge`` (2,), free edge along +X turned by ``turn`` radians; it
    opens towards its +Y.

    The object's origin is the pin, on the floor, as for any door that is to be turned by hand.
    """
    back, front = -THICKNESS, 0.0  # the pin is at the face to which the leaf opens
    parts = [block((GAP, back, GAP), (WIDTH, front, HEIGHT), 0)]
    for low, high in ((0.14, 0.86), (1.16, HEIGHT - 0.13)):  # two raised fields on either side
        for y0, y1 in ((back - 0.006, back), (front, front + 0.006)):
            parts.append(block((0.15, y0, low), (WIDTH - 0.15, y1, high), 0))
    for height in (0.25, HEIGHT / 2 + 0.05, HEIGHT - 0.22):
        parts.append(_rod((0.0, 0.006, height - 0.045), (0.0, 0.006, height + 0.045), 0.009, 1))
    x, z = WIDTH - HANDLE_FROM_EDGE, HANDLE_HEIGHT
    for side, face in ((-1.0, back), (1.0, front)):
        parts.append(_rod((x, face, z), (x, face + side * 0.010, z), 0.026, 1))
        parts.append(_rod((x, face, z), (x, face + side * 0.050, z), 0.009, 1))
        parts.append(_rod((x + 0.012, face + side * 0.048, z), (x - 0.105, face + side * 0.048, z), 0.010, 1))
        parts.append(_rod((x, face, z - 0.11), (x, face + side * 0.006, z - 0.11), 0.017, 1))
    leaf = add_parts(name, parts, [materials["Door"], materials["Brass"]], (*hinge, 0.0), turn, smooth=False)
    bevel = leaf.modifiers.new("Rounded Edges", "BEVEL")
    bevel.width, bevel.segments, bevel.limit_method = 0.003, 2, "ANGLE"
    return leaf


def add_frame(
    materials: Materials, name: str, hinge: tuple[float, float], turn: float, wall: tuple[float, float]
) -> bpy.types.Object:
    """Add the frame of a leaf at the same ``hinge`` and ``turn``; ``wall`` are the two faces of the wall, y
    from the pin, metres.
    """
    low, high = OPENING
    top = HEIGHT + GAP + LINING
    near, far = wall[0] - PROUD, wall[1] + PROUD
    parts = [
        block((low, near, 0), (-GAP, far, top), 0),
        block((WIDTH + GAP, near, 0), (high, far, top), 0),
        block((low, near, HEIGHT + GAP), (high, far, top), 0),
        # The stop that the leaf shuts against.
        block((-GAP, wall[0] + 0.01, 0), (0.012, -THICKNESS - 0.012, HEIGHT + GAP), 0),
        block((WIDTH + GAP - 0.02, wall[0] + 0.01, 0), (WIDTH + GAP, -THICKNESS - 0.012, HEIGHT + GAP), 0),
    ]
    for y0, y1 in ((near, wall[0]), (wall[1], far)):
        parts += [
            block((low - CASING, y0, 0), (low, y1, top + CASING), 0),
            block((high, y0, 0), (high + CASING, y1, top + CASING), 0),
            block((low, y0, top), (high, y1, top + CASING), 0),
        ]
    return add_parts(name, parts, [materials["Skirting"]], (*hinge, 0.0), turn, smooth=False)


def _rod(
    start: tuple[float, float, float], end: tuple[float, float, float], radius: float, tone: int
) -> LoftPart:
    """A round bar between two points."""
    a, b = np.array(start), np.array(end)
    length = float(np.linalg.norm(b - a))
    part = loft(
        [(0.0, 0, 0, radius, radius, radius), (length, 0, 0, radius, radius, radius)],
        tone,
        caps=(0.001, 0.001),
        ring=16,
    )
    z = (b - a) / length
    x = np.cross(z, (0.0, 0.0, 1.0)) if abs(z[2]) < 0.9 else np.array((1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    return LoftPart(part.vertices @ np.stack((x, np.cross(z, x), z)) + a, part.faces, tone)
