"""The ground below a way through the scene: any mesh that characters collide with, felt from above."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from nsm_core.rotations import Array

from .bvh_query import BVHQuery
from .colliders import obstacles, scene_solids, solid_seen
from .evaluated import Seen, Snapshot
from .frame import WorldFrame

_AROUND = 1.6  # metres beside the way that are looked at: the reach of the height patch, and some more
_BESIDE = 0.8  # metres beside the way within which the body may touch things
_OVER = 0.5  # metres over the hips from which the ground is felt: what is higher is a ceiling
_DEEP = 20.0  # metres below that at which the ground is given up
_LITTER = 0.25  # metres: of the copies that particles and instances make, smaller ones are no ground


class Below:
    """Heights of the ground about a way of the hips (N, 3), core frame, metres.

    Where no mesh lies below, it is ``level``.
    """

    def __init__(self, vertices: Array, triangles: Array, way: Array, level: float) -> None:
        self._tree = BVHTree.FromPolygons(vertices.tolist(), triangles.tolist())
        self._way, self._level = np.asarray(way, dtype=np.float64), level

    def __call__(self, places: Array) -> Array:
        """Heights (N,) at places (N, 2)."""
        places = np.asarray(places, dtype=np.float64)
        near = np.linalg.norm(places[:, None] - self._way[None, :, :2], axis=-1).argmin(1)
        tops = self._way[near, 2] + _OVER
        down, heights = Vector((0.0, 0.0, -1.0)), np.full(len(places), self._level)
        for row, ((x, y), top) in enumerate(zip(places.tolist(), tops.tolist(), strict=True)):
            hit = self._tree.ray_cast(Vector((x, y, top)), down, _DEEP)[0]
            if hit is not None:
                heights[row] = hit.z
        return heights


def ground_below(
    snapshot: Snapshot,
    scene: bpy.types.Scene,
    but: Sequence[bpy.types.Object],
    frame: WorldFrame,
    way: Array,
    level: float,
) -> Below | None:
    """The ground about a ``way`` (N, 3) of the hips, core frame, as a snapshot of the scene has it, without
    ``but`` and what belongs to them; None where there is no mesh near.
    """
    low, high = way[:, :2].min(0) - _AROUND, way[:, :2].max(0) + _AROUND
    vertices, triangles, count = [], [], 0
    for seen in solid_seen(snapshot, scene, but):
        found = _near(seen, frame, low, high)
        if found is not None:
            vertices.append(found[0])
            triangles.append(found[1] + count)
            count += len(found[0])
    if not vertices:
        return None
    return Below(np.concatenate(vertices), np.concatenate(triangles), way, level)


def solids_near(seen: Sequence[Seen], frame: WorldFrame, way: Array) -> list[BVHQuery]:
    """What of ``seen`` stands near a ``way`` (N, 3) of the hips, core frame, and is not walked over, each by
    itself.  It touches none of Blender's data.
    """
    low, high = way[:, :2].min(0) - _BESIDE, way[:, :2].max(0) + _BESIDE
    near = [each for each in seen if _near(each, frame, low, high) is not None]
    return [BVHQuery([solid], floor=True) for solid in obstacles(scene_solids(near, frame))]


def _near(seen: Seen, frame: WorldFrame, low: Array, high: Array) -> tuple[Array, Array] | None:
    """Vertices (V, 3), core frame, and triangles (F, 3) of what of a mesh lies over or under a rectangle of
    the floor.
    """
    points, faces = seen.mesh.faces
    points = frame.to_core(points @ seen.matrix[:3, :3].T + seen.matrix[:3, 3])
    if not len(faces) or not np.isfinite(points).all():
        return None
    if seen.instance and not seen.said and np.ptp(points, axis=0).max() < _LITTER:
        return None
    corners = points[faces][..., :2]
    faces = faces[((corners.max(1) >= low) & (corners.min(1) <= high)).all(1)]
    if not len(faces):
        return None
    used, order = np.unique(faces, return_inverse=True)
    return points[used], order.reshape(-1, 3)
