"""What a sensor asks of the world: how far is the nearest solid, and am I inside it?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import is_
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, heading_quat, quat_to_matrix

# Pairs of points and boxes compared at once; keeps the work arrays inside the processor's cache.
_PAIRS_AT_ONCE = 1 << 18


class DistanceQuery(Protocol):
    """Anything that tells how far points are from solids."""

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 in metres of world ``points`` (N, 3): negative inside, never over
        ``max_distance``.
        """
        ...


@dataclass(frozen=True)
class BoxGroup:
    """Boxes of one object that share its pose.

    ``position`` (3,) world metres; ``matrix`` (3, 3) object to world; ``centres`` and ``halves`` (M, 3)
    metres, object frame; ``heading`` in radians where the object stands upright, None where it is tilted.
    """

    position: Array
    matrix: Array
    centres: Array
    halves: Array
    heading: float | None

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Corners (3,), (3,) of the box around all boxes, object frame."""
        return (self.centres - self.halves).min(0), (self.centres + self.halves).max(0)

    @cached_property
    def sphere(self) -> tuple[Array, float]:
        """Middle (3,), world, and radius of the sphere around that box, metres."""
        lo, hi = self.bounds
        return self.position + self.matrix @ ((lo + hi) / 2), float(np.linalg.norm(hi - lo)) / 2


def box_group(position: ArrayLike, rotation: ArrayLike, mins: ArrayLike, maxs: ArrayLike) -> BoxGroup:
    """Check and pack the boxes of one object.

    ``position`` (2,) or (3,) world metres; ``rotation`` a heading in radians or a quaternion (4,);
    ``mins``, ``maxs`` (M, 3) metres, object frame.  Raises GeometryError on values that are not finite or
    on boxes turned inside out.
    """
    position = np.asarray(position, dtype=np.float64)
    position = np.append(position, 0.0) if position.shape == (2,) else position
    rotation = np.asarray(rotation, dtype=np.float64)
    mins, maxs = (np.asarray(a, dtype=np.float64).reshape(-1, 3) for a in (mins, maxs))
    if position.shape != (3,) or rotation.shape not in ((), (4,)) or mins.shape != maxs.shape:
        raise GeometryError(
            "A collider needs a position of 3 numbers, a heading or a quaternion, and as many box minima as "
            "maxima."
        )
    if not all(np.isfinite(a).all() for a in (position, rotation, mins, maxs)):
        raise GeometryError(
            "A collider holds coordinates that are not numbers; repair the object's mesh or its transform."
        )
    if (mins > maxs).any():
        raise GeometryError("A collider box has a minimum above its maximum; swap them.")
    if rotation.shape == (4,) and np.linalg.norm(rotation) < 1e-6:
        raise GeometryError("A collider's quaternion is zero; give (1, 0, 0, 0) for no rotation.")
    heading: float | None = None
    if rotation.shape == ():
        heading, quaternion = float(rotation), heading_quat(rotation)
    else:
        quaternion = rotation / np.linalg.norm(rotation)
        if abs(quaternion[1]) < 1e-6 and abs(quaternion[2]) < 1e-6:
            heading = float(2 * np.arctan2(quaternion[3], quaternion[0]))
    return BoxGroup(
        position,
        quat_to_matrix(quaternion),
        ((mins + maxs) / 2).astype(np.float32),
        ((maxs - mins) / 2).astype(np.float32),
        heading,
    )


class Cuboids:
    """Oriented boxes grouped by object (section 4.3); the collider of training data and of quick scenes.

    Outside, the distance is exact; inside overlapping boxes the depth is that of the deepest single box,
    so never more than the true depth.
    """

    def __init__(self, objects: Iterable[tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]] = ()) -> None:
        """Take (position, heading or quaternion, mins (M, 3), maxs (M, 3)) for each object; see
        ``box_group``.
        """
        packed = (box_group(*o) for o in objects)
        self.groups: list[BoxGroup] = [g for g in packed if len(g.centres)]
        self._known: list[BoxGroup] = []
        self._spheres = np.zeros((0, 4))

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 in metres of world ``points`` (N, 3): negative inside, never over
        ``max_distance``.
        """
        points = np.asarray(points)
        out = np.full(len(points), max_distance, dtype=np.float32)
        if not len(points):
            return out
        # Bounding spheres of the objects against the bounding box of all points.
        spheres = self._bounding()
        reach = spheres[:, 3:] + max_distance
        near_by = ((spheres[:, :3] + reach >= points.min(0)) & (spheres[:, :3] - reach <= points.max(0))).all(
            1
        )
        for k in np.flatnonzero(near_by):
            group = self.groups[k]
            lo, hi = group.bounds
            local = ((points - group.position) @ group.matrix).astype(np.float32)
            near = np.flatnonzero(((local > lo - max_distance) & (local < hi + max_distance)).all(1))
            if len(near):
                out[near] = np.minimum(out[near], _box_distance(local[near], group.centres, group.halves))
        return out

    def _bounding(self) -> Array:
        """Middles and radii (G, 4) of the groups' bounding spheres, made anew where the groups are others."""
        known = self._known
        if len(known) != len(self.groups) or not all(map(is_, known, self.groups)):
            self._known = list(self.groups)
            rows = [(*centre, radius) for centre, radius in (g.sphere for g in self.groups)]
            self._spheres = np.array(rows, dtype=np.float64).reshape(-1, 4)
        return self._spheres


class Union:
    """Several queries as one: the nearest solid of any of them."""

    def __init__(self, parts: Sequence[DistanceQuery]) -> None:
        self.parts = list(parts)

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 in metres of world ``points`` (N, 3): negative inside, never over
        ``max_distance``.
        """
        out = np.full(len(points), max_distance, dtype=np.float32)
        for part in self.parts:
            np.minimum(out, part.signed_distance(points, max_distance), out=out)
        return out


def _box_distance(points: Array, centres: Array, halves: Array) -> Array:
    """Signed distance (N,) of ``points`` (N, 3) to the nearest of the boxes (M, 3), all in one frame,
    float32.
    """
    out = np.empty(len(points), dtype=np.float32)
    step = max(1, _PAIRS_AT_ONCE // len(centres))
    for start in range(0, len(points), step):
        p = points[start : start + step]
        square = np.zeros((len(p), len(centres)), np.float32)
        inside = np.full_like(square, -np.inf)
        for axis in range(3):
            q = p[:, axis, None] - centres[:, axis]
            np.abs(q, out=q)
            q -= halves[:, axis]
            np.maximum(inside, q, out=inside)
            np.maximum(q, 0, out=q)
            q *= q
            square += q
        distance = np.sqrt(square.min(1))
        out[start : start + step] = np.where(distance > 0, distance, inside.min(1))
    return out
