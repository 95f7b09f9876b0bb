"""Flights of stairs found in the faces of a scene: treads that follow one another by equal steps, whether
each is an object of its own or all are one mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nsm_core.rotations import Array, direction_to_heading
from nsm_core.world.scene.stairs import LEAST_STEPS, LEAST_WIDTH, RISERS, TREADS, Flight, Stairs
from nsm_core.world.scene.terrain import HeightMap

_LEVEL = 0.03  # by which a face may be tilted, as one minus the upward part of its normal
_SAME, _NEAR = 0.01, 0.02  # metres of height within which faces are one surface, and between their corners
_SMALL = 0.08  # square metres: smaller surfaces are no treads
_RISER_OFF, _TREAD_OFF, _TURN_OFF = 0.015, 0.03, 0.06  # by which steps of one flight may differ: metres, rad
_GAP = 0.1  # metres between a tread and the edge of the next one
_ON_GROUND = 0.04  # metres
_BEHIND = 0.15  # metres behind the last edge, and before the first, where the ground goes on
_MOST = 400  # surfaces that are looked at


@dataclass(frozen=True, eq=False)
class _Surface:
    """A level surface: ``height`` metres, its triangles' corners (F, 3, 2) from above."""

    height: float
    faces: Array

    @cached_property
    def corners(self) -> Array:
        return self.faces.reshape(-1, 2)

    @cached_property
    def axes(self) -> list[Array]:
        """The four directions (2,) at right angles to its longest edge, and along it."""
        ends = np.stack((self.faces, np.roll(self.faces, -1, axis=1)), axis=2).reshape(-1, 2, 2)
        keys = np.sort(np.round(ends / _NEAR).astype(np.int64) @ (1 << 20, 1), axis=1)
        _, where, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
        ends = ends[count[where.reshape(-1)] == 1]  # edges between two triangles are none of the surface
        edges = ends[:, 1] - ends[:, 0]
        longest = edges[np.linalg.norm(edges, axis=1).argsort()[::-1]]
        found: list[Array] = []
        for edge in longest[:12]:
            unit = edge / max(float(np.linalg.norm(edge)), 1e-9)
            if all(min(abs(float(unit @ a)), abs(float(unit @ (-a[1], a[0])))) > 0.02 for a in found[::4]):
                across = np.array((-unit[1], unit[0]))
                found += [across, -across, unit, -unit]
        return found

    def holds(self, place: Array) -> bool:
        """Whether a floor point (2,) lies on it."""
        a, b, c = np.moveaxis(self.faces, 1, 0)

        def side(p: Array, q: Array) -> Array:
            return np.asarray(
                (q[:, 0] - p[:, 0]) * (place[1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (place[0] - p[:, 0])
            )

        sides = np.stack((side(a, b), side(b, c), side(c, a)))
        return bool(((sides >= -1e-6).all(0) | (sides <= 1e-6).all(0)).any())


def find_stairs(corners: Array) -> Stairs:
    """Flights among triangles (F, 3, 3), world metres, over a floor at z = 0, and landings they lead to."""
    surfaces = _surfaces(np.asarray(corners, dtype=np.float64))
    links: dict[int, list[tuple[int, Array, float, float]]] = {}
    heights = np.array([s.height for s in surfaces])
    boxes = np.array([(s.corners.min(0), s.corners.max(0)) for s in surfaces]).reshape(-1, 2, 2)
    for i, low in enumerate(surfaces):
        rises = heights - low.height
        near = (boxes[:, 0] < boxes[i, 1] + _GAP).all(1) & (boxes[:, 1] > boxes[i, 0] - _GAP).all(1)
        for j in np.flatnonzero(near & (rises >= RISERS[0]) & (rises <= RISERS[1])):
            for ahead in low.axes:
                run = _run(low, surfaces[j], ahead)
                if run is not None:
                    links.setdefault(i, []).append((int(j), ahead, float(rises[j]), run))
    chains: list[tuple[list[int], Array, float, float]] = []
    for i, ways in links.items():
        for j, ahead, rise, run in ways:
            if not any(_follows(link, i, ahead, rise, run) for others in links.values() for link in others):
                chains.append((_chain(links, i, j, ahead, rise, run), ahead, rise, run))
    chains.sort(key=lambda chain: -len(chain[0]))
    flights: list[Flight] = []
    used: set[int] = set()
    tops: list[_Surface] = []
    for chain, ahead, _, _ in chains:
        if used.intersection(chain[:-1]):
            continue
        found = _flight([surfaces[k] for k in chain], ahead, surfaces)
        if found is not None:
            flights.append(found[0])
            tops.append(found[1])
            used.update(chain[:-1])
    grounded = _grounded(flights, tops, surfaces)
    maps = (_landing(flights[k], tops[k]) for k in grounded)
    return Stairs([flights[k] for k in grounded], [found for found in maps if found is not None])


def _surfaces(corners: Array) -> list[_Surface]:
    """The level surfaces of triangles that look upward, apart where they do not touch."""
    if not len(corners):
        return []
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    up = (size > 1e-9) & (np.abs(normal[:, 2]) > (1 - _LEVEL) * size)
    faces, sign = corners[up], normal[up, 2]
    faces = faces[sign > 0]
    height = faces[..., 2].mean(1)
    faces, height = faces[height > _ON_GROUND], height[height > _ON_GROUND]
    order = np.argsort(height)
    faces, height = faces[order], height[order]
    found: list[_Surface] = []
    for part in np.split(np.arange(len(faces)), np.flatnonzero(np.diff(height) > _SAME) + 1):
        for group in _touching(faces[part][..., :2]) if len(part) else []:
            own = faces[part[group]]
            flat = own[..., :2]
            one, two = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
            doubled = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
            if doubled.sum() / 2 > _SMALL:
                found.append(_Surface(float(np.median(own[..., 2])), flat))
    return found[:_MOST]


def _touching(faces: Array) -> list[Array]:
    """Groups of triangles (F, 3, 2) that share corners, as indices."""
    keys = np.round(faces.reshape(-1, 2) / _NEAR).astype(np.int64)
    _, corner = np.unique(keys, axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    label = np.arange(corner.max() + 1)
    while True:
        least = label[corner].min(1)
        new = label.copy()
        np.minimum.at(new, corner.reshape(-1), np.repeat(least, 3))
        if (new == label).all():
            break
        label = new
    own = label[corner[:, 0]]
    return [np.flatnonzero(own == k) for k in np.unique(own)]


def _run(low: _Surface, high: _Surface, ahead: Array) -> float | None:
    """Metres from the front edge of one surface to that of the next, if that follows it ``ahead`` (2,)."""
    one, other = low.corners @ ahead, high.corners @ ahead
    run = float(other.min() - one.min())
    if not TREADS[0] <= run <= TREADS[1] or one.max() < other.min() - _GAP:
        return None
    wide = low.corners @ (-ahead[1], ahead[0]), high.corners @ (-ahead[1], ahead[0])
    both = min(w.max() for w in wide) - max(w.min() for w in wide)
    return run if both >= LEAST_WIDTH else None


def _follows(link: tuple[int, Array, float, float], to: int, ahead: Array, rise: float, run: float) -> bool:
    """Whether a link leads to a surface as the one that goes on from there."""
    j, way, own_rise, own_run = link
    alike = abs(own_rise - rise) < _RISER_OFF and abs(own_run - run) < _TREAD_OFF
    return j == to and alike and float(way @ ahead) > 1 - _TURN_OFF**2 / 2


def _chain(
    links: dict[int, list[tuple[int, Array, float, float]]],
    first: int,
    second: int,
    ahead: Array,
    rise: float,
    run: float,
) -> list[int]:
    chain = [first, second]
    while True:
        ways = [link for link in links.get(chain[-1], []) if link[0] not in chain]
        after = next((link for link in ways if _follows(link, link[0], ahead, rise, run)), None)
        if after is None:
            return chain
        chain.append(after[0])


def _flight(chain: list[_Surface], ahead: Array, surfaces: list[_Surface]) -> tuple[Flight, _Surface] | None:
    """The flight of a chain of surfaces, and its landing: the last of them, or what goes on behind it."""
    front = np.array([float((s.corners @ ahead).min()) for s in chain])
    heights = np.array([s.height for s in chain])
    tread = float(np.diff(front).mean())
    riser = float(np.diff(heights).mean())
    side = np.array((-ahead[1], ahead[0]))
    treads = chain[:-1] if len(chain) > 2 else chain
    low = max(float((s.corners @ side).min()) for s in treads)
    high = min(float((s.corners @ side).max()) for s in treads)
    if high - low < LEAST_WIDTH:
        return None
    middle, top = (low + high) / 2, chain[-1]
    behind = (front[-1] + tread + _BEHIND) * ahead + middle * side
    on = next(
        (s for s in surfaces if abs(s.height - top.height - riser) < _RISER_OFF and s.holds(behind)), None
    )
    steps = len(chain)
    if on is not None and not top.holds(behind):
        steps, top = steps + 1, on
    if steps < LEAST_STEPS:
        return None
    base = float(heights[0]) - riser
    foot = front[0] * ahead + middle * side
    heading = float(direction_to_heading(ahead))
    return Flight(
        foot, heading, high - low, tread, riser, steps, 0.0 if abs(base) < _ON_GROUND else base
    ), top


def _grounded(flights: list[Flight], tops: list[_Surface], surfaces: list[_Surface]) -> list[int]:
    """The flights that are come to: from the floor, or from the landing of another."""
    known = [k for k, flight in enumerate(flights) if flight.base == 0.0]
    while True:
        more = [
            k
            for k, flight in enumerate(flights)
            if k not in known
            and any(
                abs(tops[m].height - flight.base) < _ON_GROUND and tops[m].holds(flight.at(-_BEHIND))
                for m in known
            )
        ]
        if not more:
            return known
        known += more


def _landing(flight: Flight, top: _Surface) -> HeightMap | None:
    """What of a surface lies behind the highest riser: an upper floor is over rooms of the lower one, too."""
    corners = np.concatenate((top.faces, np.full((*top.faces.shape[:2], 1), top.height)), axis=-1)
    found = HeightMap.over(corners)
    if found is None:
        return None
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in found.heights.shape), indexing="ij"), axis=-1)
    along = flight.local(found.origin + found.cell * cells)[..., 0]
    return replace(found, heights=np.where(along > flight.length - 2 * found.cell, found.heights, 0.0))


__all__ = ["find_stairs"]
