"""The limit that keeps a body out of solids: its capsules' spheres, and what they lack to be clear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from nsm_core.body.capsules import SPHERES, Spheres
from nsm_core.body.near_spheres import near_spheres
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery

from .solver import Pose, Rows

PAD = 0.004  # metres between flesh and solids that are asked for
NEAR = 0.07  # metres off the flesh up to which spheres are looked at again in each round
DEVIATION = 0.004
MOST_ROWS = 10  # of a frame: its deepest spheres
LOWEST, _DOWN = 0.35, -0.5  # metres over the floor under which no way leads down; the slope of such a way
_STEP = 0.004  # metres by which points are moved to see which way distances grow


@dataclass
class Obstacle:
    """Something solid: ``query`` in the world, or in the frame of what has the ``poses`` (T, 4).

    ``free`` (T, S) tells by how much spheres may be inside it, metres: what holds it, or stands on it.
    """

    query: DistanceQuery
    poses: Array | None = None
    free: Array | None = None

    def during(self, span: slice) -> Obstacle:
        """The same over some of the frames."""
        if self.poses is None:
            return self
        return Obstacle(self.query, self.poses[span], None if self.free is None else self.free[span])

    def distance(self, frames: Array, points: Array, reach: float) -> Array:
        """Distances (N,), metres, at most ``reach``, of world ``points`` (N, 3) in ``frames`` (N,)."""
        if not len(points):
            return np.zeros(0)
        if self.poses is not None:
            at = self.poses[frames]
            points = rotate_planar(points - at[:, :3], -at[:, 3])
        return self.query.signed_distance(points.astype(np.float32), reach).astype(np.float64)

    def normals(self, frames: Array, points: Array, distances: Array) -> Array:
        """Unit ways (N, 3) in which the distances (N,) of points (N, 3) grow; zero where there is none."""
        count = len(points)
        moved = (points[:, None] + _STEP * np.eye(3)).reshape(-1, 3)
        reach = float(distances.max(initial=0.0)) + 0.05
        ahead = self.distance(np.repeat(frames, 3), moved, reach).reshape(count, 3)
        way = (ahead - distances[:, None]) / _STEP
        size = np.linalg.norm(way, axis=1, keepdims=True)
        return np.where(size > 0.3, way / np.maximum(size, 1e-9), 0.0)


@dataclass
class Clearance:
    """Keep the spheres of a body out of ``solids``; ``left_out`` (S,) are not looked at."""

    solids: Sequence[Obstacle]
    left_out: Array
    spheres: Spheres = SPHERES
    refresh: int = 3  # rounds after which it is looked anew which spheres are near
    _near: dict[int, list[tuple[Array, Array]]] = field(default_factory=dict)
    _rounds: dict[int, int] = field(default_factory=dict)

    def rows(self, pose: Pose, span: slice) -> Rows:
        first = span.start
        done = self._rounds[first] = self._rounds.get(first, -1) + 1
        anew = done % self.refresh == 0
        if not anew and not any(len(t) for t, _ in self._near[first]):
            return self._of(pose, pose.positions, [])
        centres, radii = self.spheres.of(pose.positions, pose.world)
        solids = [solid.during(span) for solid in self.solids]
        if anew:
            self._near[first] = []
            for solid in solids:
                t, s = near_spheres(solid.distance, centres, radii, self.spheres, NEAR)
                seen = ~self.left_out[s]
                self._near[first].append((t[seen], s[seen]))
        parts = []
        for solid, (t, s) in zip(solids, self._near[first], strict=True):
            if not len(t):
                continue
            distance = solid.distance(t, centres[t, s], float(radii.max()) + 0.02)
            lack = radii[t, s] + PAD - distance
            if solid.free is not None:
                lack = lack - solid.free[t, s]
            deep = np.flatnonzero(lack > 0)
            t, s, lack, distance = t[deep], s[deep], lack[deep], distance[deep]
            ways = solid.normals(t, centres[t, s], distance)
            # Nobody leaves a solid that stands on the floor through its underside.
            low = (ways[:, 2] < _DOWN) & (centres[t, s, 2] < LOWEST)
            parts.append((t, s, np.where(low, 0.0, lack), ways))
        return self._of(pose, centres, parts)

    def _of(self, pose: Pose, centres: Array, parts: Sequence[tuple[Array, ...]]) -> Rows:
        count = len(pose.hips)
        if parts:
            frames, index, lack, ways = (np.concatenate(column) for column in zip(*parts, strict=True))
        if not parts or not len(frames):
            return Rows(
                np.zeros((count, 0)),
                np.ones((count, 0)),
                np.zeros((count, 0, 3 + 3 * len(pose.tree.parents))),
            )
        order = np.lexsort((-lack, frames))
        frames, index, lack, ways = frames[order], index[order], lack[order], ways[order]
        rank = np.arange(len(frames)) - np.searchsorted(frames, frames)
        kept = rank < MOST_ROWS
        frames, index, lack, ways, rank = frames[kept], index[kept], lack[kept], ways[kept], rank[kept]
        width = int(rank.max()) + 1
        error, deviation = np.zeros((count, width)), np.full((count, width), np.inf)
        jacobian = np.zeros((count, width, 3 + 3 * len(pose.tree.parents)))
        error[frames, rank] = lack
        deviation[frames, rank] = DEVIATION
        own = pose.part(frames).of_points(
            centres[frames, index][:, None], self.spheres.moved[index][:, None], ways[:, None]
        )
        jacobian[frames, rank] = own[:, 0]
        return Rows(error, deviation, jacobian)


__all__ = ["Clearance", "Obstacle"]
