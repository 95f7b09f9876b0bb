"""What of a scene is walked over: rugs, mats, thresholds, kerbs, low podiums and the uneven floor of
a room.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.affordances.flights import find_stairs
from nsm_core.world.scene.stairs import Stairs
from nsm_core.world.scene.terrain import FLOOR_TOP, HeightMap, Terrain

from .solids import Solid, placed

# Metres over the floor under which everything counts as floor, and the longest side from which on a thing of
# up to FLOOR_TOP does: one steps on a mat or a threshold, but round a shoe, a bowl or a book.
_PAPER, _MAT = 0.03, 0.45
# Objects this wide both ways may hold the floor of a room; their faces at floor level are floor, metres.
ROOM_WIDTH = 2.5
_ON_TOP = 0.015  # metres by which a character may stand over or in the rug that it is placed on


def is_ground(solid: Solid) -> bool:
    """Whether a mesh is walked over as a whole."""
    if solid.top_at_least > FLOOR_TOP + 5e-3:  # most of what stands around, without a look at its corners
        return False
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    return bool(high[2] < _PAPER or high[2] <= FLOOR_TOP + 1e-4 and (high - low)[:2].max() >= _MAT)


def floor_faces(vertices: Array, triangles: Array) -> Array:
    """Which triangles (F,) of a mesh, ``vertices`` (V, 3) in metres over the floor, are a room's floor, with
    its low edges.
    """
    if not (np.ptp(vertices[:, :2], axis=0) > ROOM_WIDTH).all():
        return np.zeros(len(triangles), bool)
    return ~(vertices[triangles][..., 2] > FLOOR_TOP + 1e-4).any(1)


def terrain_of(shapes: Iterable[Solid]) -> Terrain:
    """The heights of everything that is walked over; ``shapes`` are those of the scene, core frame."""
    maps = (_top_of(shape) for shape in shapes)
    return Terrain(found for found in maps if found is not None)


def stairs_of(shapes: Iterable[Solid]) -> Stairs:
    """The flights of stairs among the ``shapes`` of a scene, core frame, whether a mesh is one or a tread."""
    high = [shape for shape in shapes if shape.bounds[1][2] > FLOOR_TOP]
    corners = [shape.vertices[shape.triangles] for shape in high if len(shape.triangles)]
    return find_stairs(np.concatenate(corners)) if corners else Stairs()


def _top_of(shape: Solid) -> HeightMap | None:
    """What of a mesh is walked over; as long as its reading is kept, it is found once for where it stands."""
    low, high = shape.bounds
    whole = is_ground(shape)
    if not whole and not ((high - low)[:2] > ROOM_WIDTH).all():
        return None
    kept, key = shape.reading.kept, placed([shape])
    if kept.get("top", (b"", None))[0] != key:
        points = shape.vertices
        chosen = shape.triangles if whole else shape.triangles[floor_faces(points, shape.triangles)]
        kept["top"] = key, HeightMap.over(points[chosen]) if len(chosen) else None
    return kept["top"][1]


def floor_under(place: Array, scale: float, scene: bpy.types.Scene, but: Iterable[bpy.types.Object]) -> float:
    """Height, Blender units, of the floor for a character whose origin is at ``place`` (3,): that under the
    rug it stands on.

    Who is placed on a rug that lies on the world's floor, or on a floor of the scene, walks off it one step
    down.
    """
    boxes = _boxes_around(place[:2], scene, set(but))

    def ends_at(high: Array, height: float) -> bool:
        return abs(float(high[2]) - height) <= _ON_TOP * scale

    floor = float(place[2])
    for low, high in boxes:
        if ends_at(high, float(place[2])) and 0.004 * scale < high[2] - low[2] <= FLOOR_TOP * scale:
            rests = abs(float(low[2])) < 1e-3 * scale or any(
                ends_at(h, float(low[2])) and h is not high for _, h in boxes
            )
            floor = min(floor, float(low[2])) if rests else floor
    return floor


def _boxes_around(
    place: Array, scene: bpy.types.Scene, but: set[bpy.types.Object]
) -> list[tuple[Array, Array]]:
    """Corners (3,), (3,), Blender units, of the boxes around the meshes that are seen over or under ``place``
    (2,).

    Thousands of objects are asked at once: one by one they would keep the window for seconds.
    """
    objects = scene.objects
    matrices, corners = np.empty(16 * len(objects), np.float32), np.empty(24 * len(objects), np.float32)
    objects.foreach_get("matrix_world", matrices)
    objects.foreach_get("bound_box", corners)
    with np.errstate(invalid="ignore", over="ignore"):  # broken scales
        columns = matrices.reshape(-1, 4, 4).astype(np.float64)
        corners = corners.reshape(-1, 8, 3).astype(np.float64) @ columns[:, :3, :3] + columns[:, 3:, :3]
    low, high = corners.min(1), corners.max(1)
    near = np.flatnonzero(((low[:, :2] <= place) & (place <= high[:, :2])).all(1))
    seen = [
        k
        for k, o in ((int(k), objects[int(k)]) for k in near)
        if o.type == "MESH" and o not in but and o.visible_get()
    ]
    return [(low[k], high[k]) for k in seen]
