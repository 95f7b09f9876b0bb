"""Trees of triangles that lie together, each built when something is asked of it first, and which face of one
is nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from nsm_core.rotations import Array
from nsm_core.world.geometry.mesh_reading import Reading

# Triangles in one tree: Blender builds it in one go, in some 30 ms.
_CHUNK = 36_000
# Share of its distance by which a point must be over a face at least so that the face alone tells its side.
_SQUARE = 0.999


class Chunk:
    """A part of some triangles that lies together; its tree is built when something is asked of it first.

    Trees are built by Blender in one go, so no single one may be large.
    """

    def __init__(self, vertices: Array, triangles: Array, sides: Array, owners: Array | None) -> None:
        used, faces = np.unique(triangles, return_inverse=True)
        self._vertices, self._faces = vertices[used].astype(np.float32), faces.reshape(-1, 3).astype(np.int32)
        self.sides, self.owners = sides, owners
        self.low, self.high = self._vertices.min(0), self._vertices.max(0)

    @cached_property
    def tree(self) -> BVHTree:
        """Its triangles as a tree."""
        return BVHTree.FromPolygons(self._vertices.tolist(), self._faces.tolist(), all_triangles=True)


def chunks_of(vertices: Array, triangles: Array, sides: Array, owners: Array | None = None) -> list[Chunk]:
    """Part triangles (F, 3) with their sides and owners (F,) into chunks that lie together, cut across the
    longest way.
    """
    if not len(triangles):
        return []
    middle, parts, done = vertices[triangles].mean(1), [np.arange(len(triangles))], []
    while parts:
        part = parts.pop()
        if len(part) <= _CHUNK:
            done.append(part)
            continue
        along = middle[part, int(np.ptp(middle[part], axis=0).argmax())]
        pieces = -(-len(part) // _CHUNK)
        cut = len(part) * (pieces // 2) // pieces
        order = part[np.argpartition(along, cut)]
        parts += [order[cut:], order[:cut]]
    return [Chunk(vertices, triangles[p], sides[p], None if owners is None else owners[p]) for p in done]


def own_chunks(reading: Reading) -> list[Chunk]:
    """The chunks of one mesh in its own frame, for all who ask."""
    if "chunks" not in reading.kept:
        reading.kept["chunks"] = chunks_of(reading.vertices, reading.triangles, reading.sides)
    return reading.kept["chunks"]


def near_box(points: Array, distance: Array, low: Array, high: Array) -> Array:
    """Rows of points (N, 3) nearer to a box than they are, by ``distance`` (N,), to anything so far."""
    reach = distance[:, None]
    return np.flatnonzero(((points >= low - reach) & (points <= high + reach)).all(1))


def bring_nearer(
    chunk: Chunk, points: Array, rows: Array, size: float, only: int | None,
    distance: Array, inside: Array, on_surface: Array, owners: Array | None,
) -> None:  # fmt: skip
    """Bring ``distance``, ``inside`` and ``owners`` (None: nobody asks) up to date in ``rows`` (M,) with a
    chunk.

    ``points`` (M, 3) are as the chunk sees them, which is ``size`` times as large in the scene; ``only``: the
    owner of all of it.
    """
    find, sides = chunk.tree.find_nearest, chunk.sides
    limits = (distance[rows] / size).tolist()
    found = [find(point, limit) for point, limit in zip(points.tolist(), limits, strict=True)]
    near = [k for k, hit in enumerate(found) if hit[3] is not None]
    if not near:
        return
    hits = rows[near]
    distance[hits] = np.array([found[k][3] for k in near]) * size
    judged = on_surface[hits] if owners is None else np.ones(len(hits), bool)
    for n in np.flatnonzero(judged).tolist():
        k, i = near[n], hits[n]
        if on_surface[i]:
            place, normal, face, d = found[k]
            point = points[k].tolist()
            height = sides[face] * _height(normal, point, place)
            if height < 0 or abs(height) < _SQUARE * d:
                height = _judged(chunk, point, place, d)
            inside[i] = height < 0
        if owners is not None and (owners[i] < 0 or not inside[i]):
            owners[i] = chunk.owners[found[k][2]] if only is None else only


def _height(normal: Vector, point: Sequence[float], place: Vector) -> float:
    """How far a point is over a face that looks along ``normal`` through ``place``."""
    nx, ny, nz = normal
    x, y, z = place
    return nx * (point[0] - x) + ny * (point[1] - y) + nz * (point[2] - z)


def _judged(chunk: Chunk, point: Sequence[float], place: Vector, distance: float) -> float:
    """How far a point is over the face, of those that meet in ``place``, that says most: negative inside a
    closed part.

    Next to a sharp edge or corner a point may lie behind the plane of one of its faces and yet be outside;
    the face that it is farthest over or under tells.  Where two say as much, as the two leaves of a fold
    without thickness do, it is outside.
    """
    most, least, within = 0.0, 0.0, max(1e-5, 1e-4 * distance)
    for _, normal, face, _ in chunk.tree.find_nearest_range(place, within):
        height = chunk.sides[face] * _height(normal, point, place)
        most, least = max(most, height), min(least, height)
    return least if -least > most + 1e-3 * distance else max(most, 0.0)
