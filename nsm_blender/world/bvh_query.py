"""Distances to the meshes of a scene, and the objects that are nearest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.dilation import grown
from nsm_core.world.geometry.mesh_reading import Reading
from nsm_core.world.scene.terrain import FLOOR_TOP
from nsm_core.world.sensors.environment import SPHERE_RADIUS

from .beside import freely
from .chunks import Chunk, bring_nearer, chunks_of, near_box, own_chunks
from .ground import ROOM_WIDTH, floor_faces
from .solids import Solid

# The coarse map of where anything is near: reach and cell size, metres, and the most cells.
_REACH = float(np.ceil(SPHERE_RADIUS * 100) / 100)
_COARSE_CELL = 0.1
_MOST_CELLS = 4_000_000
_FEW = 200  # points are asked at once without letting Blender go on
# Triangles from which a mesh has trees of its own, which are kept with its reading, and those that all copies
# of one mesh may have before they share them, each being asked by itself.
_LARGE, _MANY = 12_000, 200_000
_PAIRS = 1 << 20  # of points and solids that are compared at once


class BVHQuery:
    """Distances to triangle meshes by ``mathutils.bvhtree``; implements
    ``nsm_core.world.geometry.distance.DistanceQuery``.

    Distances are exact.  A point is inside where the voxels of a mesh (4 cm) close it off from the outside,
    whichever way faces look; and, within the voxels of the surface itself, where it lies behind a face of a
    closed part.  So open and broken meshes are solid where their gaps are narrower than a voxel, and thin
    shells elsewhere.
    """

    still = True  # what it has answered once it will answer again

    def __init__(self, solids: Sequence[Solid], floor: bool = False) -> None:
        """Take what is solid, all of it in one frame.

        With a ``floor``, which lies at zero, faces of room-sized meshes at its height are part of it and are
        left out.
        """
        self.solids, self._floor = list(solids), floor
        self._chunks: list[Chunk] = []
        self._copies: list[tuple[Solid, int]] = []
        if not self.solids:
            return
        bounds = np.array([s.bounds for s in self.solids])
        self._low, self._high = (
            (bounds[:, 0] - 1e-6).astype(np.float32),
            (bounds[:, 1] + 1e-6).astype(np.float32),
        )
        self._share(floor)
        self._map_nearness(floor)

    @classmethod
    def from_triangles(cls, vertices: Array, triangles: Array) -> BVHQuery:
        """Query over one mesh: ``vertices`` (V, 3) and ``triangles`` (F, 3); GeometryError where it has no
        faces.
        """
        return cls([Solid.of(vertices, triangles)])

    def _share(self, floor: bool) -> None:
        """Put the triangles of all small meshes together; a large one, or one that is shown often, has trees
        of its own.
        """
        times = Counter(id(s.reading) for s in self.solids)
        vertices, triangles, sides, owners, start = [], [], [], [], 0
        for k, solid in enumerate(self.solids):
            faces, side = solid.reading.triangles, solid.reading.sides
            left = len(faces)
            if floor and _is_wide(solid):
                above = ~floor_faces(solid.vertices, faces)
                faces, side = faces[above], side[above]
            if len(faces) == left and (left > _LARGE or times[id(solid.reading)] * left > _MANY):
                self._copies.append((solid, k))
                continue
            vertices.append(solid.vertices)
            triangles.append(faces + start)
            sides.append(side)
            owners.append(np.full(len(faces), k, np.int32))
            start += len(solid.vertices)
        if vertices:
            self._chunks = chunks_of(*(np.concatenate(a) for a in (vertices, triangles, sides, owners)))

    def _map_nearness(self, floor: bool) -> None:
        """Mark the coarse cells within reach of any solid voxel; most sphere centres are elsewhere."""
        low, high = (
            self._low.min(0).astype(np.float64) - _REACH,
            self._high.max(0).astype(np.float64) + _REACH,
        )
        voxel = max(float((s.size * s.reading.cell).max()) for s in self.solids)
        cell = max(_COARSE_CELL, voxel, float(np.cbrt(np.prod(high - low) / _MOST_CELLS)))
        margin = int(np.ceil((_REACH + 2 * voxel * np.sqrt(0.75)) / cell))
        shape = np.ceil((high - low) / cell).astype(int) + 2 * margin + 1
        self._near_low, self._near_cell = (low - margin * cell).astype(np.float32), np.float32(cell)
        near = np.zeros(tuple(shape), dtype=bool)
        alike: dict[tuple[int, bool], list[Solid]] = {}
        for solid in self.solids:
            alike.setdefault((id(solid.reading), floor and _is_wide(solid)), []).append(solid)
        for (_, wide), copies in alike.items():
            middles = _blocks(copies[0].reading)
            several = max(1, _PAIRS // max(len(middles), 1))
            for first in range(0, len(copies), several):
                some = copies[first : first + several]
                turned = middles @ np.array([s.size * s.turn.T for s in some])
                places = (turned + np.array([s.origin for s in some])[:, None]).reshape(-1, 3)
                if wide:
                    places = places[places[:, 2] > FLOOR_TOP]
                near[tuple(((places - self._near_low) / cell).astype(np.int64).T)] = True
        self._near = np.ascontiguousarray(grown(near, margin))

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 in metres of ``points`` (N, 3): negative inside, never over
        ``max_distance``.

        Deeper inside than ``max_distance`` the answer is ``-max_distance``.
        """
        if len(points) < _FEW:
            return self._ask(points, max_distance, None)
        with freely():
            return self._ask(points, max_distance, None)

    def nearest(self, points: Array, max_distance: float) -> list[str | None]:
        """The names of the objects nearest to ``points`` (N, 3), or in which they lie; None where none is
        within ``max_distance``.
        """
        of = np.full(len(points), -1)
        self._ask(points, max_distance, of)
        return [None if k < 0 else self.solids[k].owner for k in of.tolist()]

    def without(self, name: str) -> BVHQuery:
        """The same without what belongs to one object."""
        return BVHQuery([s for s in self.solids if s.owner != name], self._floor)

    def _ask(self, points: Array, max_distance: float, of: Array | None) -> Array:
        """Distances (N,) of points (N, 3); the numbers of the solids nearest to them go to ``of`` (N,)."""
        points = np.asarray(points, dtype=np.float32)
        out = np.full(len(points), max_distance, dtype=np.float32)
        if not self.solids or not len(points):
            return out
        rows = self._candidates(points, max_distance)
        if not len(rows):
            return out
        p = points[rows]
        code, within = self._codes(p)
        distance = np.full(len(rows), max_distance, dtype=np.float32)
        inside, on_surface = code == 2, code == 1
        owner = None if of is None else within
        for chunk in self._chunks:
            some = (
                np.arange(len(p)) if len(self._chunks) == 1 else near_box(p, distance, chunk.low, chunk.high)
            )
            bring_nearer(chunk, p[some], some, 1.0, None, distance, inside, on_surface, owner)
        for solid, k in self._copies:
            some = near_box(p, distance, self._low[k], self._high[k])
            if not len(some):
                continue
            chunks, local = (
                own_chunks(solid.reading),
                ((p[some] - solid.origin) @ (solid.turn / solid.size)).astype(np.float32),
            )
            for chunk in chunks:
                near = (
                    slice(None)
                    if len(chunks) == 1
                    else near_box(local, distance[some] / solid.size, chunk.low, chunk.high)
                )
                bring_nearer(
                    chunk, local[near], some[near], solid.size, k, distance, inside, on_surface, owner
                )
        out[rows] = np.where(inside, -distance, distance)
        if of is not None:
            of[rows] = owner
        return out

    def _candidates(self, points: Array, max_distance: float) -> Array:
        """Rows of the points that may lie within ``max_distance`` of a mesh, or inside one."""
        if max_distance > _REACH:
            low, high = self._low.min(0) - max_distance, self._high.max(0) + max_distance
            return np.flatnonzero(((points >= low) & (points <= high)).all(1))
        cells = np.floor((points - self._near_low) / self._near_cell).astype(np.int64)
        rows = np.flatnonzero(((cells >= 0) & (cells < self._near.shape)).all(1))
        return rows[self._near[tuple(cells[rows].T)]]

    def _codes(self, points: Array) -> tuple[Array, Array]:
        """Greatest code (N,) of any mesh at points (N, 3), and the number (N,) of one in which they lie, -1
        for none.
        """
        code, of = np.zeros(len(points), dtype=np.int8), np.full(len(points), -1)
        solids = np.flatnonzero(((self._low <= points.max(0)) & (self._high >= points.min(0))).all(1))
        # Part the points until each part meets few solids.
        if len(solids) * len(points) > _PAIRS and len(points) > 64:
            order = np.argsort(points[:, int(np.ptp(points, axis=0).argmax())])
            for half in np.array_split(order, 2):
                code[half], of[half] = self._codes(points[half])
            return code, of
        if not len(solids):
            return code, of
        low, high, (x, y, z) = self._low[solids, :, None], self._high[solids, :, None], points.T
        within = (
            (x >= low[:, 0])
            & (x <= high[:, 0])
            & (y >= low[:, 1])
            & (y <= high[:, 1])
            & (z >= low[:, 2])
            & (z <= high[:, 2])
        )
        for i in np.flatnonzero(within.any(1)):
            k = int(solids[i])
            at = np.flatnonzero(within[i])
            own = self.solids[k].at(points[at])
            code[at] = np.maximum(code[at], own)
            of[at[own == 2]] = k
        return code, of


def _blocks(reading: Reading) -> Array:
    """Middles (K, 3), own frame, of the blocks of two by two by two voxels in which something is solid."""
    code = reading.code > 0
    code = np.pad(code, [(0, n % 2) for n in code.shape])
    for axis in range(3):
        code = np.moveaxis(np.moveaxis(code, axis, 0)[::2] | np.moveaxis(code, axis, 0)[1::2], 0, axis)
    return reading.low + (2 * np.argwhere(code) + 1) * reading.cell


def _is_wide(solid: Solid) -> bool:
    low, high = solid.bounds
    return bool((high - low)[:2].min() > ROOM_WIDTH)
