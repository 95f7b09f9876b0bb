"""Measure doors whose leaf and handle are parts of their own, so that doors like them can be made."""

from __future__ import annotations

import re

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array

# What a part of a mesh is, by the words in its name and its size, metres.
_NOT_LEAF = re.compile("frame|doorway|wall", re.IGNORECASE)
_LEAF_WIDTH, _LEAF_HEIGHT, _LEAF_THICKEST = (0.6, 1.2), 1.7, 0.12
_HANDLE_HEIGHTS, _HANDLE_TALLEST = (0.6, 1.4), 0.5
# What is made of odd measures, metres: hands must get hold of it and bodies pass.
LIMITS = {
    "width": (0.72, 1.1),
    "height": (1.9, 2.2),
    "panel": (0.025, 0.08),
    "grips": (0.09, 0.2),
    "handle_height": (0.8, 1.15),
    "handle_edge": (0.04, 0.13),
    "lever": (0.02, 0.16),
    "depth": (0.06, 0.25),
}


def door_measures(parts: list[tuple[str, Array, Array]]) -> dict[str, float]:
    """Measure a door, width along X: the overrides of ``door.make_door`` that make one like it, metres,
    within ``LIMITS``.

    ``parts`` are names, vertices (V, 3) and triangles; the leaf is told from its frame by name and size.
    Raises GeometryError where there is no single leaf or no handle.
    """
    bounds = [(name, v.min(0), v.max(0)) for name, v, _ in parts]
    low, high = min(b[1][2] for b in bounds), np.max([b[2] for b in bounds], axis=0)
    leaves = [(name, a, b) for name, a, b in bounds if not _NOT_LEAF.search(name) and _is_leaf(b - a)]
    # Panels and panes lie within their leaf.
    leaves = [
        x
        for x in leaves
        if not any(
            y is not x and (y[1] <= x[1] + 0.01)[[0, 2]].all() and (y[2] >= x[2] - 0.01)[[0, 2]].all()
            for y in leaves
        )
    ]
    if len(leaves) != 1:
        raise GeometryError(
            f"It has {len(leaves)} parts that could be the leaf; name the frame's parts so, and choose "
            "doors of one leaf."
        )
    leaf, a, b = leaves[0]
    middle, half = (a + b) / 2, (b - a) / 2
    handles = [
        (p, q)
        for name, p, q in bounds
        if name != leaf
        and not _NOT_LEAF.search(name)
        and q[2] - p[2] < _HANDLE_TALLEST
        and _HANDLE_HEIGHTS[0] < (p[2] + q[2]) / 2 - low < _HANDLE_HEIGHTS[1]
        and max(q[1] - middle[1], middle[1] - p[1]) > half[1] + 0.01  # sticks out
        and abs((p[0] + q[0]) / 2 - middle[0]) > 0.4 * half[0]
    ]
    if not handles:
        raise GeometryError("Its handle is no part of its own; choose a door with a handle.")
    p, q = np.min([h[0] for h in handles], axis=0), np.max([h[1] for h in handles], axis=0)
    # How far the handle's ends lie from the free edge, which is the nearer one.
    ends = sorted((b[0] - q[0], b[0] - p[0]) if p[0] + q[0] > 2 * middle[0] else (p[0] - a[0], q[0] - a[0]))
    frame = [(c, d) for name, c, d in bounds if _NOT_LEAF.search(name)]
    depth = max((d[1] - c[1] for c, d in frame), default=2 * half[1])
    edge = max(ends[0], 0) + 0.03
    found = {
        "width": 2 * half[0],
        "height": min(b[2], high[2]) - low,
        "panel": 2 * half[1],
        "grips": 2 * max(q[1] - middle[1], middle[1] - p[1]),
        "handle_height": (p[2] + q[2]) / 2 - low,
        "handle_edge": edge,
        "lever": ends[1] - edge,
        "depth": depth,
    }
    return {name: float(np.clip(value, *LIMITS[name])) for name, value in found.items()}


def _is_leaf(size: Array) -> bool:
    return bool(
        _LEAF_WIDTH[0] < size[0] < _LEAF_WIDTH[1] and size[2] > _LEAF_HEIGHT and size[1] < _LEAF_THICKEST
    )
