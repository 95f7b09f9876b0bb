"""What is solid in a Blender scene, as a distance query over its evaluated meshes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from nsm_core.rotations import Array
from nsm_core.sensors.closed import face_sides
from nsm_core.sensors.cylinder import SPHERE_RADIUS
from nsm_core.sensors.voxels import VoxelGrid, voxelise

from .evaluated import Shape, evaluated_shapes, object_mesh_triangles
from .ground import floor_faces, is_ground
from .scene import WorldFrame

__all__ = ["BVHQuery", "gather_colliders", "object_mesh_triangles"]

# Set to False on an object, in its custom properties, to let characters walk through it.
COLLIDER_PROPERTY = "nsm_collider"
# The coarse map of where anything is near: reach and cell size, metres, and the most cells.
_REACH = float(np.ceil(SPHERE_RADIUS * 100) / 100)
_COARSE_CELL = 0.1
_MOST_CELLS = 4_000_000


@dataclass(frozen=True)
class _Solid:
    """Inside of one mesh: 0 free, 1 on the surface, 2 inside, as a grid over its bounding box, world frame."""

    low: Array
    high: Array
    cell: Array
    code: Array

    @classmethod
    def of(cls, grid: VoxelGrid) -> _Solid:
        code = np.where(grid.surface, 1, np.where(grid.solid, 2, 0)).astype(np.int8)
        return cls(grid.origin, grid.origin + grid.cell * code.shape, grid.cell, code)

    def at(self, points: Array) -> Array:
        """Codes (N,) at points (N, 3) that lie within the bounding box."""
        index = np.clip(((points - self.low) / self.cell).astype(np.int64), 0, np.array(self.code.shape) - 1)
        return self.code[tuple(index.T)]


class BVHQuery:
    """Distances to triangle meshes by ``mathutils.bvhtree``; implements ``nsm_core.sensors.query.DistanceQuery``.

    Distances are exact.  A point is inside where the voxels of a mesh (4 cm) close it off from the outside, whichever
    way faces look; and, within the voxels of the surface itself, where it lies behind a face of a closed part.  So
    open and broken meshes are solid where their gaps are narrower than a voxel, and thin shells elsewhere.
    """

    def __init__(self, meshes: Iterable[tuple[Array, Array]], floor: float | None = None) -> None:
        """Take (vertices (V, 3) world, triangles (F, 3)) of each object.

        With a ``floor`` height, faces of room-sized meshes at or below it count as floor and are left out.
        Raises GeometryError on meshes without faces or with coordinates that are not finite.
        """
        vertices, triangles, sides, self._solids, start = [], [], [], [], 0
        for v, t in meshes:
            v, t = np.asarray(v, dtype=np.float64), np.asarray(t, dtype=np.int64)
            grid, side = voxelise(v, t), face_sides(v, t)
            self._solids.append(_Solid.of(grid))
            if floor is not None:
                above = ~floor_faces(v - (0, 0, floor), t)
                t, side = t[above], side[above]
            if (np.ptp(v, axis=0) > (1.0, 1.0, 1.5)).all():
                side = np.zeros_like(side)  # maybe a closed room with the character inside
            vertices.append(v)
            triangles.append(t + start)
            sides.append(side)
            start += len(v)
        self._tree: BVHTree | None = None
        if not self._solids or not sum(map(len, triangles)):
            return
        corners, faces = np.concatenate(vertices), np.concatenate(triangles)
        self._sides = np.concatenate(sides)
        self._low = np.array([s.low for s in self._solids], dtype=np.float32)
        self._high = np.array([s.high for s in self._solids], dtype=np.float32)
        self._tree = BVHTree.FromPolygons(corners.tolist(), faces.tolist(), all_triangles=True)
        self._map_nearness()

    @classmethod
    def from_triangles(cls, vertices: Array, triangles: Array) -> BVHQuery:
        """Query over one mesh: world ``vertices`` (V, 3) and ``triangles`` (F, 3); GeometryError where it has no faces."""
        return cls([(vertices, triangles)])

    def _map_nearness(self) -> None:
        """Mark the coarse cells within reach of any solid voxel; most sphere centres are elsewhere."""
        low, high = self._low.min(0).astype(np.float64) - _REACH, self._high.max(0).astype(np.float64) + _REACH
        cell = max(_COARSE_CELL, *(float(s.cell.max()) for s in self._solids), float(np.cbrt(np.prod(high - low) / _MOST_CELLS)))
        margin = int(np.ceil(_REACH / cell))
        shape = np.ceil((high - low) / cell).astype(int) + 2 * margin + 1
        self._near_low, self._near_cell = (low - margin * cell).astype(np.float32), np.float32(cell)
        near = np.zeros(tuple(shape), dtype=bool)
        for solid in self._solids:
            cells = np.argwhere(solid.code > 0)
            for corner in np.ndindex(2, 2, 2):
                at = ((solid.low + (cells + corner) * solid.cell - self._near_low) / cell).astype(np.int64)
                near[tuple(np.minimum(at, shape - 1).T)] = True
        for axis in range(3):
            line = np.moveaxis(near, axis, 0)
            spread = line.copy()
            for step in range(1, margin + 1):
                spread[step:] |= line[:-step]
                spread[:-step] |= line[step:]
            near = np.moveaxis(spread, 0, axis)
        self._near = np.ascontiguousarray(near)

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 in metres of world ``points`` (N, 3): negative inside, never over ``max_distance``.

        Deeper inside than ``max_distance`` the answer is ``-max_distance``.
        """
        points = np.asarray(points, dtype=np.float32)
        out = np.full(len(points), max_distance, dtype=np.float32)
        if self._tree is None or not len(points):
            return out
        rows = self._candidates(points, max_distance)
        code = self._codes(points, rows)
        find, sides = self._tree.find_nearest, self._sides
        distance = np.full(len(rows), max_distance, dtype=np.float32)
        inside = code == 2
        for i, (point, on_surface) in enumerate(zip(points[rows].tolist(), (code == 1).tolist(), strict=True)):
            place, normal, face, d = find(point, max_distance)
            if d is None:
                continue
            distance[i] = d
            if on_surface and (side := sides[face]):
                behind = sum(n * (a - b) for n, a, b in zip(normal, point, place, strict=True))
                inside[i] = behind * side < 0
        out[rows] = np.where(inside, -distance, distance)
        return out

    def _candidates(self, points: Array, max_distance: float) -> Array:
        """Rows of the points that may lie within ``max_distance`` of a mesh, or inside one."""
        if max_distance > _REACH:
            low, high = self._low.min(0) - max_distance, self._high.max(0) + max_distance
            return np.flatnonzero(((points >= low) & (points <= high)).all(1))
        cells = np.floor((points - self._near_low) / self._near_cell).astype(np.int64)
        rows = np.flatnonzero(((cells >= 0) & (cells < self._near.shape)).all(1))
        return rows[self._near[tuple(cells[rows].T)]]

    def _codes(self, points: Array, rows: Array) -> Array:
        """Greatest code of any mesh (K,) at the points of ``rows``."""
        code = np.zeros(len(rows), dtype=np.int8)
        p = points[rows]
        within = np.ones((len(self._solids), len(rows)), dtype=bool)
        for axis in range(3):
            within &= p[:, axis] >= self._low[:, axis, None]
            within &= p[:, axis] <= self._high[:, axis, None]
        for k in np.flatnonzero(within.any(1)):
            at = np.flatnonzero(within[k])
            code[at] = np.maximum(code[at], self._solids[k].at(p[at]))
        return code


def gather_colliders(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    exclude: Iterable[bpy.types.Object] = (),
    frame: WorldFrame = WorldFrame(),  # noqa: B008
) -> BVHQuery:
    """Build the query over everything solid in the scene as evaluated now, at its current frame, in the core's ``frame``.

    Left out: ``exclude`` and whatever is parented to or deformed by one of it, objects hidden in the viewport or in
    renders, objects with the custom property "nsm_collider" switched off, and floors: whatever ends less than 3 cm
    over the floor, and the faces at that height of room-sized meshes.  A scene without colliders gives a query that finds
    nothing.  Raises GeometryError on coordinates that are not finite.
    """
    if depsgraph is None:
        depsgraph = bpy.context.evaluated_depsgraph_get()
    return BVHQuery([(s.vertices, s.triangles) for s in collider_shapes(scene, depsgraph, list(exclude), frame)], 0.0)


def collider_shapes(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    exclude: Sequence[bpy.types.Object] = (),
    frame: WorldFrame = WorldFrame(),  # noqa: B008
) -> list[Shape]:
    """Meshes of the scene that characters collide with, in the core's ``frame``, chosen as ``gather_colliders`` says."""
    return [s for s in solid_shapes(scene, depsgraph, exclude, frame) if not is_ground(s.vertices)]


def solid_shapes(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    exclude: Sequence[bpy.types.Object] = (),
    frame: WorldFrame = WorldFrame(),  # noqa: B008
) -> list[Shape]:
    """The same and what characters walk over."""
    excluded = {o.name_full for o in exclude}
    owners = [o for o in scene.objects if not _left_out(o, excluded, depsgraph.view_layer)]
    return [replace(s, vertices=frame.to_core(s.vertices)) for s in evaluated_shapes(depsgraph, owners)]


def _left_out(candidate: bpy.types.Object, excluded: set[str], layer: bpy.types.ViewLayer) -> bool:
    if candidate.hide_render or not candidate.visible_get(view_layer=layer) or not candidate.get(COLLIDER_PROPERTY, True):
        return True
    if any(m.type == "ARMATURE" and m.object is not None and m.object.name_full in excluded for m in candidate.modifiers):
        return True
    ancestor: bpy.types.Object | None = candidate
    while ancestor is not None:
        if ancestor.name_full in excluded:
            return True
        ancestor = ancestor.parent
    return False
