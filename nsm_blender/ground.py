"""What of a scene is walked over: rugs, mats, thresholds, kerbs, low podiums and the uneven floor of a room."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from nsm_core.control.terrain import FLOOR_TOP, HeightMap, Terrain
from nsm_core.rotations import Array

from .solids import Solid

# Metres over the floor under which everything counts as floor, and the longest side from which on a thing of up to FLOOR_TOP
# does: one steps on a mat or a threshold, but round a shoe, a bowl or a book.
_PAPER, _MAT = 0.03, 0.45
# Objects this wide both ways may hold the floor of a room; their faces at floor level are floor, metres.
ROOM_WIDTH = 2.5
_ON_TOP = 0.015  # metres by which a character may stand over or in the rug that it is placed on


def is_ground(vertices: Array) -> bool:
    """Whether a mesh, ``vertices`` (V, 3) in metres over the character's floor, is walked over as a whole."""
    low, high = vertices.min(0), vertices.max(0)
    return bool(high[2] < _PAPER or high[2] <= FLOOR_TOP + 1e-4 and (high - low)[:2].max() >= _MAT)


def floor_faces(vertices: Array, triangles: Array) -> Array:
    """Which triangles (F,) of a mesh, ``vertices`` (V, 3) in metres over the floor, are a room's floor, with its low edges."""
    if not (np.ptp(vertices[:, :2], axis=0) > ROOM_WIDTH).all():
        return np.zeros(len(triangles), bool)
    return ~(vertices[triangles][..., 2] > FLOOR_TOP + 1e-4).any(1)


def ground_of(shapes: Iterable[Solid]) -> Terrain:
    """The heights of everything that is walked over; ``shapes`` are those of the scene, core frame."""
    maps = []
    for shape in shapes:
        points = shape.vertices
        chosen = shape.triangles if is_ground(points) else shape.triangles[floor_faces(points, shape.triangles)]
        found = HeightMap.over(points[chosen]) if len(chosen) else None
        if found is not None:
            maps.append(found)
    return Terrain(maps)


def floor_under(place: Array, scale: float, scene: bpy.types.Scene, but: Iterable[bpy.types.Object]) -> float:
    """Height, Blender units, of the floor for a character whose origin is at ``place`` (3,): that under the rug it stands on.

    Who is placed on a rug that lies on the world's floor, or on a floor of the scene, walks off it one step down.
    """
    left_out, boxes = set(but), []
    for candidate in scene.objects:
        if candidate.type == "MESH" and candidate not in left_out and candidate.visible_get():
            matrix = np.array(candidate.matrix_world)
            corners = np.array(candidate.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
            boxes.append((corners.min(0), corners.max(0)))

    def under(high: Array, low: Array, height: float) -> bool:
        return bool((low[:2] <= place[:2]).all() and (place[:2] <= high[:2]).all()) and abs(float(high[2]) - height) <= _ON_TOP * scale

    floor = float(place[2])
    for low, high in boxes:
        if under(high, low, float(place[2])) and 0.004 * scale < high[2] - low[2] <= FLOOR_TOP * scale:
            rests = abs(float(low[2])) < 1e-3 * scale or any(under(h, b, float(low[2])) and h is not high for b, h in boxes)
            floor = min(floor, float(low[2])) if rests else floor
    return floor
