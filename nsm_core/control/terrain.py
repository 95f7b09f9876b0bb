"""How high the ground is that feet step on: the tops of what a character climbs, the floor elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..rotations import Array, heading_to_direction, rotate_planar
from ..sensors.cuboid import InteractionVolume
from ..sensors.query import DistanceQuery

CELL = 0.02  # metres between the places that are probed
_TOUCH, _STEPS = 0.002, 80  # metres over a surface that count as on it; steps of a probe at most
_HIGHEST = 0.8  # metres: what is higher is no ground


@dataclass(frozen=True)
class HeightMap:
    """Heights of one object's tops in a frame of its own.

    ``origin`` (2,) world place of the first cell's centre, ``heading`` of the frame, ``heights`` (nx, ny) metres over the floor.
    """

    origin: Array
    heading: float
    heights: Array

    def at(self, points: Array) -> Array:
        """Heights (N,) at floor points (N, 2), 0 off the map."""
        cell = np.rint(rotate_planar(points - self.origin, np.float64(-self.heading)) / CELL).astype(int)
        inside = ((cell >= 0) & (cell < self.heights.shape)).all(-1)
        i, j = np.where(inside[..., None], cell, 0).T
        return np.where(inside, self.heights[i, j], 0.0)


class Terrain:
    """Ground made of height maps over the floor at z = 0; without any it is flat."""

    def __init__(self, maps: Iterable[HeightMap] = ()) -> None:
        self.maps = list(maps)

    def __bool__(self) -> bool:
        return bool(self.maps)

    def height(self, points: Array) -> Array:
        """Heights (N,) in metres of the ground at floor points (N, 2), world."""
        points = np.asarray(points, dtype=np.float64)
        out = np.zeros(len(points))
        for each in self.maps:
            np.maximum(out, each.at(points), out=out)
        return out

    @classmethod
    def probe(cls, query: DistanceQuery, volume: InteractionVolume) -> Terrain:
        """Feel the tops of ``query`` from above, inside the box of an object's sensor reading."""
        count = np.maximum(2, np.ceil(np.asarray(volume.size[:2], dtype=np.float64) / CELL).astype(int) + 1)
        steps = [CELL * (np.arange(n) - (n - 1) / 2) for n in count]
        local = np.stack(np.meshgrid(*steps, indexing="ij"), -1)
        points = rotate_planar(local.reshape(-1, 2), np.float64(volume.heading)) + np.asarray(volume.centre[:2], dtype=np.float64)
        top = min(float(volume.centre[2] + volume.size[2] / 2), _HIGHEST) + 0.02
        z, falling = np.full(len(points), top), np.arange(len(points))
        for _ in range(_STEPS):
            if not len(falling):
                break
            probe = np.column_stack((points[falling], z[falling])).astype(np.float32)
            distance = query.signed_distance(probe, top + 0.1).astype(np.float64)
            # What starts inside is higher than anything to stand on; it stays at the top and is left out below.
            moving = (distance > _TOUCH) & (z[falling] > 0)
            z[falling[moving]] -= distance[moving]
            falling = falling[moving]
        z[(z < 2 * _TOUCH) | (z > top - 0.005)] = 0
        heights = z.reshape(tuple(count)) - np.where(z > 0, _TOUCH, 0).reshape(tuple(count)) / 2
        if not heights.any():
            return cls()
        return cls([HeightMap(points[0], float(volume.heading), heights)])


def merged(terrains: Iterable[Terrain | None]) -> Terrain:
    """All the maps of several terrains as one."""
    return Terrain(m for t in terrains if t is not None for m in t.maps)


def around(place: Array, size: float = 1.6) -> InteractionVolume:
    """The volume (without a reading) in which to feel for the ground under a ``place`` (3,) to stand on, metres."""
    height = max(float(place[2]), 0.0) + 0.05
    return InteractionVolume(np.array((*place[:2], height / 2)), np.array((size, size, height)), 0.0, np.zeros(0, np.float32))


def edge_before(volume: InteractionVolume, place: Array, heading: float) -> float:
    """Metres from ``place`` (2,) back against ``heading`` to where the object's footprint begins for one who comes that way."""
    back = rotate_planar(-heading_to_direction(np.array(heading)), np.float64(-volume.heading))
    start = rotate_planar(np.asarray(place, dtype=np.float64)[:2] - volume.centre[:2], np.float64(-volume.heading))
    half = np.asarray(volume.size[:2], dtype=np.float64) / 2
    slope = np.where(np.abs(back) < 1e-9, 1e-9, back)
    ends = np.stack(((-half - start) / slope, (half - start) / slope))
    first, last = float(ends.min(0).max()), float(ends.max(0).min())
    if first <= last and last > 0:
        return last
    return max(0.0, float(np.abs(back) @ half - start @ back))  # it lies beside: as far as the footprint reaches that way


__all__ = ["HeightMap", "Terrain", "around", "edge_before", "merged"]
