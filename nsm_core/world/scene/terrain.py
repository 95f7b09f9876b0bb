"""How high the ground is that feet step on: rugs and thresholds, the tops of what a character climbs, the
floor elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.geometry.triangles import expanded
from nsm_core.world.sensors.interaction import InteractionVolume

CELL = 0.02  # metres between the places that are probed
# What ends lower over the floor, metres, is ground that one walks over: rugs, mats, thresholds, kerbs; what
# is higher stands in the way or is climbed.  No body is looked for below it (``clearance_map.HEIGHTS``).
FLOOR_TOP = 0.12
_TOUCH, _STEPS = 0.002, 80  # metres over a surface that count as on it; steps of a probe at most
_HIGHEST = 0.8  # metres: what is higher is no ground
_REACH = _HIGHEST / 4  # metres to the side of a point in which ground is looked for
_LEVEL = 1e-4  # metres within which heights are the same
_PROBES = 1 << 17  # places that are looked at at once
_LEAST_HEIGHT = 0.004  # metres: what is lower is as good as painted on the floor
_MOST_CELLS = 400_000  # cells of one map of a mesh


@dataclass(frozen=True)
class HeightMap:
    """Heights of one object's tops in a frame of its own.

    ``origin`` (2,) world place of the first cell's centre, ``heading`` of the frame, ``heights`` (nx, ny)
    metres over the floor, ``cell`` metres between them.
    """

    origin: Array
    heading: float
    heights: Array
    cell: float = CELL

    def at(self, points: Array) -> Array:
        """Heights (N,) at floor points (N, 2), 0 off the map."""
        local = points - self.origin
        if self.heading:
            local = rotate_planar(local, np.float64(-self.heading))
        cell = np.rint(local / self.cell).astype(int)
        inside = ((cell >= 0) & (cell < self.heights.shape)).all(-1)
        i, j = np.where(inside[..., None], cell, 0).T
        return np.where(inside, self.heights[i, j], 0.0)

    @classmethod
    def over(cls, corners: Array) -> HeightMap | None:
        """The tops of triangles (F, 3, 3), world metres, seen from above; None where nothing lies over the
        floor.
        """
        corners = np.asarray(corners, dtype=np.float64)
        corners = corners[corners[..., 2].max(1) > _LEAST_HEIGHT] if len(corners) else corners
        if not len(corners):
            return None
        low, high = corners[..., :2].min((0, 1)), corners[..., :2].max((0, 1))
        cell = max(CELL, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
        shape = np.maximum(2, np.ceil((high - low) / cell).astype(int))
        heights, origin = np.zeros(shape[0] * shape[1]), low + cell / 2
        places = (corners[..., :2] - origin) / cell
        # Triangles that cover no cell's middle count by their corners, the others by every middle in their
        # bounding box.
        corner_cells = np.clip(np.rint(places.reshape(-1, 2)).astype(int), 0, shape - 1)
        np.maximum.at(
            heights, corner_cells[:, 0] * shape[1] + corner_cells[:, 1], corners[..., 2].reshape(-1)
        )
        first = np.maximum(np.ceil(places.min(1) - 1e-6).astype(int), 0)
        size = np.maximum(np.minimum(np.floor(places.max(1) + 1e-6).astype(int), shape - 1) - first + 1, 0)
        a, b, c = np.moveaxis(places, 1, 0)
        double = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        size[np.abs(double) < 1e-9] = 0  # upright ones cover nothing
        for face, step in expanded(size[:, 0] * size[:, 1]):
            i, j = first[face, 0] + step // size[face, 1], first[face, 1] + step % size[face, 1]
            shares = [_double(i, j, p[face], q[face]) / double[face] for p, q in ((b, c), (c, a), (a, b))]
            hit = np.minimum(np.minimum(*shares[:2]), shares[2]) >= -1e-6
            z = sum(share[hit] * corners[face[hit], k, 2] for k, share in enumerate(shares))
            np.maximum.at(heights, i[hit] * shape[1] + j[hit], z)
        return cls(origin, 0.0, heights.reshape(tuple(shape)), cell)

    @cached_property
    def circle(self) -> tuple[Array, float]:
        """Middle (2,) and radius of the circle around it, metres."""
        half = self.cell * (np.array(self.heights.shape, dtype=np.float64) - 1) / 2
        return self.origin + rotate_planar(half, np.float64(self.heading)), float(
            np.linalg.norm(half)
        ) + self.cell

    @cached_property
    def spread(self) -> HeightMap:
        """At every place the greatest height within ``_REACH`` of it, along both axes, at least."""
        count = int(np.ceil(_REACH * np.sqrt(2) / self.cell)) + 2
        out = np.pad(self.heights, count)
        for axis in (0, 1):
            line, wide = np.moveaxis(out, axis, 0), np.moveaxis(out.copy(), axis, 0)
            for step in range(1, count + 1):
                np.maximum(wide[step:], line[:-step], out=wide[step:])
                np.maximum(wide[:-step], line[step:], out=wide[:-step])
            out = np.moveaxis(wide, 0, axis)
        corner = rotate_planar(np.full(2, count * self.cell), np.float64(self.heading))
        return HeightMap(self.origin - corner, self.heading, np.ascontiguousarray(out), self.cell)


def _double(i: Array, j: Array, p: Array, q: Array) -> Array:
    """Twice the areas (N,) of triangles between points ``i``, ``j`` (N,), ``p`` and ``q`` (N, 2),
    counter-clockwise ones positive.
    """
    return (p[:, 0] - i) * (q[:, 1] - j) - (p[:, 1] - j) * (q[:, 0] - i)


class Terrain:
    """Ground made of height maps over the floor at z = 0; without any it is flat."""

    def __init__(self, maps: Iterable[HeightMap] = ()) -> None:
        self.maps = list(maps)

    def __bool__(self) -> bool:
        return bool(self.maps)

    def add(self, other: Terrain) -> None:
        """Take in the maps of another terrain."""
        self.maps += other.maps
        for made in ("_circles", "_spread"):
            self.__dict__.pop(made, None)

    def height(self, points: Array) -> Array:
        """Heights (N,) in metres of the ground at floor points (N, 2), world."""
        points = np.asarray(points, dtype=np.float64)
        out = np.zeros(len(points))
        if not self.maps or not len(points):
            return out
        middles, reaches = self._circles
        near = ((middles + reaches >= points.min(0)) & (middles - reaches <= points.max(0))).all(1)
        for k in np.flatnonzero(near):
            np.maximum(out, self.maps[k].at(points), out=out)
        return out

    @cached_property
    def _spread(self) -> Terrain:
        """At every place the greatest height within ``_REACH`` of it, along both axes, at least."""
        return Terrain(each.spread for each in self.maps)

    @cached_property
    def _circles(self) -> tuple[Array, Array]:
        """Middles (M, 2) and radii (M, 1) of the circles around the maps, metres."""
        circles = [each.circle for each in self.maps]
        return np.array([middle for middle, _ in circles]), np.array([[reach] for _, reach in circles])

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32, metres, of world ``points`` (N, 3) to what of the ground lies over the
        floor, right to a cell.

        See ``DistanceQuery``.
        """
        points = np.asarray(points, dtype=np.float64)
        out = np.full(len(points), max_distance, dtype=np.float32)
        tops = self._spread.height(points[:, :2])
        low = np.flatnonzero((tops > 0) & (points[:, 2] < tops + max_distance))
        own, up = self.height(points[low, :2]), points[low, 2]
        level = (
            (own > 0) & (tops[low] - own < _LEVEL) & (up >= own)
        )  # nothing about is nearer than what is below
        out[low[level]] = np.minimum(up - own, max_distance)[level]
        low, own = low[~level], own[~level]
        if not len(low):
            return out
        reach = int(min(max_distance, _REACH) / CELL)
        offsets = CELL * np.stack(
            np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij"), -1
        ).reshape(-1, 2)
        far = np.linalg.norm(offsets, axis=1)
        offsets, far = offsets[far < max_distance], far[far < max_distance]
        beside = np.maximum(0, far - CELL / 2)  # a cell reaches half its width to the point
        step = max(1, _PROBES // len(far))
        for start in range(0, len(low), step):
            rows = low[start : start + step]
            p, o = points[rows], own[start : start + step]
            h = self.height((p[:, None, :2] + offsets).reshape(-1, 2)).reshape(len(p), -1)
            over = np.hypot(beside, np.maximum(p[:, 2:] - h, 0))
            outside = np.where(h > 0, over, max_distance).min(1, initial=max_distance)
            inside = np.where(h <= p[:, 2:], far, max_distance).min(1, initial=max_distance)
            deep = np.minimum(o - p[:, 2], inside)
            out[rows] = np.where((o > 0) & (deep > 0), -deep, outside)
        return out

    @classmethod
    def probe(cls, query: DistanceQuery, volume: InteractionVolume) -> Terrain:
        """Feel the tops of ``query`` from above, inside the box of an object's sensor reading."""
        count = np.maximum(2, np.ceil(np.asarray(volume.size[:2], dtype=np.float64) / CELL).astype(int) + 1)
        steps = [CELL * (np.arange(n) - (n - 1) / 2) for n in count]
        local = np.stack(np.meshgrid(*steps, indexing="ij"), -1)
        points = rotate_planar(local.reshape(-1, 2), np.float64(volume.heading)) + np.asarray(
            volume.centre[:2], dtype=np.float64
        )
        top = min(float(volume.centre[2] + volume.size[2] / 2), _HIGHEST) + 0.02
        z, falling = np.full(len(points), top), np.arange(len(points))
        for _ in range(_STEPS):
            if not len(falling):
                break
            probe = np.column_stack((points[falling], z[falling])).astype(np.float32)
            distance = query.signed_distance(probe, top + 0.1).astype(np.float64)
            # What starts inside is higher than anything to stand on; it stays at the top and is left out
            # below.
            moving = (distance > _TOUCH) & (z[falling] > 0)
            z[falling[moving]] -= distance[moving]
            falling = falling[moving]
        z[(z < 2 * _TOUCH) | (z > top - 0.005)] = 0
        heights = z.reshape(tuple(count)) - np.where(z > 0, _TOUCH, 0).reshape(tuple(count)) / 2
        if not heights.any():
            return cls()
        return cls([HeightMap(points[0], float(volume.heading), heights)])


class Floor:
    """The floor and the low ground on it as a solid, for what comes from above: hands."""

    def __init__(self, low: Terrain | None = None) -> None:
        self.low = low or Terrain()

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Heights (N,) float32 of points (N, 3) over the floor, never over ``max_distance``; see
        ``DistanceQuery``.
        """
        points = np.asarray(points)
        height = points[:, 2] - self.low.height(points[:, :2]) if self.low else points[:, 2]
        return np.clip(height, -max_distance, max_distance).astype(np.float32)


def merged(terrains: Iterable[Terrain | None]) -> Terrain:
    """All the maps of several terrains as one."""
    return Terrain(m for t in terrains if t is not None for m in t.maps)


def around(place: Array, size: float = 1.6) -> InteractionVolume:
    """The volume (without a reading) in which to feel for the ground under a ``place`` (3,) to stand on,
    metres.
    """
    height = max(float(place[2]), 0.0) + 0.05
    return InteractionVolume(
        np.array((*place[:2], height / 2)), np.array((size, size, height)), 0.0, np.zeros(0, np.float32)
    )


def edge_before(volume: InteractionVolume, place: Array, heading: float) -> float:
    """Metres from ``place`` (2,) back against ``heading`` to where the object's footprint begins for one who
    comes that way.
    """
    back = rotate_planar(-heading_to_direction(np.array(heading)), np.float64(-volume.heading))
    start = rotate_planar(
        np.asarray(place, dtype=np.float64)[:2] - volume.centre[:2], np.float64(-volume.heading)
    )
    half = np.asarray(volume.size[:2], dtype=np.float64) / 2
    slope = np.where(np.abs(back) < 1e-9, 1e-9, back)
    ends = np.stack(((-half - start) / slope, (half - start) / slope))
    first, last = float(ends.min(0).max()), float(ends.max(0).min())
    if first <= last and last > 0:
        return last
    # It lies beside: as far as the footprint reaches that way.
    return max(0.0, float(np.abs(back) @ half - start @ back))


__all__ = ["FLOOR_TOP", "Floor", "HeightMap", "Terrain", "around", "edge_before", "merged"]
