"""What is solid in a Blender scene, as a distance query over its evaluated meshes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from nsm_core.rotations import Array
from nsm_core.world.geometry.mesh_reading import Reading
from nsm_core.world.scene.terrain import FLOOR_TOP
from nsm_core.world.sensors.environment import SPHERE_RADIUS

from .beside import freely
from .evaluated import COLLIDER_PROPERTY, Seen, Snapshot, object_mesh_triangles
from .frame import WorldFrame
from .ground import ROOM_WIDTH, floor_faces, is_ground
from .solids import Solid, is_litter, placed, solids_of

__all__ = ["COLLIDER_PROPERTY", "BVHQuery", "collider_shapes", "gather_colliders", "object_mesh_triangles"]

# The coarse map of where anything is near: reach and cell size, metres, and the most cells.
_REACH = float(np.ceil(SPHERE_RADIUS * 100) / 100)
_COARSE_CELL = 0.1
_MOST_CELLS = 4_000_000
_FEW = 200  # points are asked at once without letting Blender go on
# Triangles in one tree: Blender builds it in one go, in some 30 ms.  Triangles from which a mesh has trees of
# its own, which are kept with its reading, and those that all copies of one mesh may have before they share
# them, each being asked by itself; pairs of points and solids compared at once.
# Share of its distance by which a point must be over a face at least so that the face alone tells its side.
_SQUARE = 0.999
_CHUNK, _LARGE, _MANY, _PAIRS = 36_000, 12_000, 200_000, 1 << 20


class _Chunk:
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


def _chunks(vertices: Array, triangles: Array, sides: Array, owners: Array | None = None) -> list[_Chunk]:
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
    return [_Chunk(vertices, triangles[p], sides[p], None if owners is None else owners[p]) for p in done]


def _own_chunks(reading: Reading) -> list[_Chunk]:
    """The chunks of one mesh in its own frame, for all who ask."""
    if "chunks" not in reading.kept:
        reading.kept["chunks"] = _chunks(reading.vertices, reading.triangles, reading.sides)
    return reading.kept["chunks"]


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
        self._chunks: list[_Chunk] = []
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
            self._chunks = _chunks(*(np.concatenate(a) for a in (vertices, triangles, sides, owners)))

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
        for axis in range(3):
            line = np.moveaxis(near, axis, 0)
            spread = line.copy()
            for step in range(1, margin + 1):
                spread[step:] |= line[:-step]
                spread[:-step] |= line[step:]
            near = np.moveaxis(spread, 0, axis)
        self._near = np.ascontiguousarray(near)

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
                np.arange(len(p)) if len(self._chunks) == 1 else _near_box(p, distance, chunk.low, chunk.high)
            )
            _nearest(chunk, p[some], some, 1.0, None, distance, inside, on_surface, owner)
        for solid, k in self._copies:
            some = _near_box(p, distance, self._low[k], self._high[k])
            if not len(some):
                continue
            chunks, local = (
                _own_chunks(solid.reading),
                ((p[some] - solid.origin) @ (solid.turn / solid.size)).astype(np.float32),
            )
            for chunk in chunks:
                near = (
                    slice(None)
                    if len(chunks) == 1
                    else _near_box(local, distance[some] / solid.size, chunk.low, chunk.high)
                )
                _nearest(chunk, local[near], some[near], solid.size, k, distance, inside, on_surface, owner)
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


def _near_box(points: Array, distance: Array, low: Array, high: Array) -> Array:
    """Rows of points (N, 3) nearer to a box than they are, by ``distance`` (N,), to anything so far."""
    reach = distance[:, None]
    return np.flatnonzero(((points >= low - reach) & (points <= high + reach)).all(1))


def _nearest(
    chunk: _Chunk, points: Array, rows: Array, size: float, only: int | None,
    distance: Array, inside: Array, on_surface: Array, owners: Array | None,
) -> None:  # fmt: skip
    """Bring ``distance``, ``inside`` and ``owners`` (None: nobody asks) up to date in ``rows`` (M,) with a
    chunk.

    ``points`` (M, 3) are as the chunk sees them, which is ``size`` times as large in the scene; ``only``: the
    owner of all of it.
    """
    find, sides = chunk.tree.find_nearest, chunk.sides
    asked = zip(
        rows.tolist(),
        points.tolist(),
        (distance[rows] / size).tolist(),
        on_surface[rows].tolist(),
        strict=True,
    )
    for i, point, limit, touching in asked:
        place, normal, face, d = find(point, limit)
        if d is None:
            continue
        distance[i] = d * size
        if touching:
            height = sides[face] * _height(normal, point, place)
            if height < 0 or abs(height) < _SQUARE * d:
                height = _judged(chunk, point, place, d)
            inside[i] = height < 0
        if owners is not None and (owners[i] < 0 or not inside[i]):
            owners[i] = chunk.owners[face] if only is None else only


def _height(normal: Sequence[float], point: Sequence[float], place: Sequence[float]) -> float:
    """How far a point is over a face that looks along ``normal`` through ``place``."""
    return sum(n * (a - b) for n, a, b in zip(normal, point, place, strict=True))


def _judged(chunk: _Chunk, point: Sequence[float], place: Sequence[float], distance: float) -> float:
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


def gather_colliders(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    exclude: Iterable[bpy.types.Object] = (),
    frame: WorldFrame = WorldFrame(),  # noqa: B008
) -> BVHQuery:
    """Build the query over everything solid in the scene as evaluated now, at its current frame, in the
    core's ``frame``.

    Solid is what ``collider_shapes`` says; the faces of room-sized meshes at floor level are floor and are
    left out.  A scene without colliders gives a query that finds nothing.  Raises GeometryError on
    coordinates that are not finite.
    """
    if depsgraph is None:
        depsgraph = bpy.context.evaluated_depsgraph_get()
    return query_of(collider_shapes(scene, depsgraph, list(exclude), frame))


def collider_shapes(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    exclude: Sequence[bpy.types.Object] = (),
    frame: WorldFrame = WorldFrame(),  # noqa: B008
) -> list[Solid]:
    """Meshes of the scene that characters collide with, in the core's ``frame``: what looks solid in the
    viewport.

    Left out: ``exclude`` and whatever is parented to or deformed by one of it; what is hidden in the
    viewport, shown as wire or bounds, or has materials without a surface, as fog has; copies as small as
    grass and pebbles; and what is walked over as
    ``ground.is_ground`` says.  What is only hidden in renders, or from the camera, or held out is solid, as
    it is seen.  The custom property "nsm_collider" on an object wins over looks: switched off it is no
    collider, switched on it is one, even hidden.
    """
    return obstacles(scene_solids(solid_seen(Snapshot.now(depsgraph), scene, exclude), frame))


def scene_solids(
    seen: Sequence[Seen], frame: WorldFrame, said: Callable[[float], None] = lambda _: None
) -> list[Solid]:
    """Read what is seen as solid, without litter but with what is walked over; ``said`` hears how far that
    is, 0..1.
    """
    made = zip(seen, solids_of(seen, frame, said), strict=True)
    return [solid for s, solid in made if not (s.instance and not s.said and is_litter(solid))]


def obstacles(solids: Iterable[Solid]) -> list[Solid]:
    """Those that are not walked over."""
    return [s for s in solids if not is_ground(s)]


def solid_seen(snapshot: Snapshot, scene: bpy.types.Scene, exclude: Iterable[bpy.types.Object]) -> list[Seen]:
    """What of a snapshot looks solid, or is said to be, but for ``exclude`` and what belongs to it."""
    left_out = belonging_to(scene, exclude)
    return [
        s for s in snapshot.seen if s.owner not in left_out and (s.looks_solid if s.said is None else s.said)
    ]


def belonging_to(scene: bpy.types.Scene, owners: Iterable[bpy.types.Object]) -> set[str]:
    """Full names of some objects and of all that hang on one of them or are deformed by one."""
    names = {o.name_full for o in owners}
    return {o.name_full for o in scene.objects if _belongs_to(o, names)} if names else names


def query_of(solids: Sequence[Solid]) -> BVHQuery:
    """The query over what is solid above the floor; the one made last for the same solids is given again."""
    global _last
    key, names = placed(solids), [s.owner for s in solids]
    last = _last
    if last is None or last[0] != (key, names):
        # The query holds its readings, so that none of their numbers is given to another one while it is
        # kept.
        last = _last = (key, names), BVHQuery(solids, floor=True)
    return last[1]


_last: tuple[tuple[bytes, list[str]], BVHQuery] | None = None


def forget() -> None:
    """Keep no query."""
    global _last
    _last = None


def _belongs_to(candidate: bpy.types.Object, owners: set[str]) -> bool:
    """Whether an object is one of ``owners``, hangs on one, or is deformed by one."""
    if any(
        m.type == "ARMATURE" and m.object is not None and m.object.name_full in owners
        for m in candidate.modifiers
    ):
        return True
    ancestor: bpy.types.Object | None = candidate
    while ancestor is not None:
        if ancestor.name_full in owners:
            return True
        ancestor = ancestor.parent
    return False
