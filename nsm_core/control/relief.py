"""Walking over low ground: rugs, mats, thresholds and kerbs raise the floor on which the network believes to
stand.

The network was trained on a flat floor.  Its world is raised and lowered with the ground about the root: what
it senses and what it is sent to is told over that ground, and the pose that it makes is lifted by it; feet
find their own ground in
``footing``.  A plain addition to the paper, which knows flat floors only.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.stairs import Stairs
from nsm_core.world.scene.terrain import Terrain
from nsm_core.world.sensors.interaction import InteractionVolume

# metres about the root over which the ground is averaged: half a stride, so hips rise while the step is made
_REACH = 0.3
_RINGS = ((0.0, 1), (0.15, 6), (_REACH, 12))
_ABOUT = np.concatenate(
    [[(r * np.cos(a), r * np.sin(a)) for a in 2 * np.pi * np.arange(count) / count] for r, count in _RINGS]
)  # (19, 2) metres
_QUICK = 12.0  # 1/s: how soon hips follow the ground, without a jolt
_ON_GROUND = 0.02  # metres over the ground that a goal may be and still lie on it


class Relief:
    """The ground under one walker; one call of ``follow`` a frame.  Without terrain it is flat and costs
    nothing.
    """

    def __init__(self, terrain: Terrain, root: Array, stairs: Stairs | None = None) -> None:
        """``terrain`` is what is walked over, ``root`` (2,) where the walker stands; ``stairs`` raise the
        floor as they did in the training data.
        """
        self.terrain, self.stairs = terrain, stairs or Stairs()
        self.low = self._mean(root)  # metres by which low ground raises the walker
        self._pace, self._climbed = 0.0, self._on_stairs(root)

    @property
    def level(self) -> float:
        """Metres by which the walker's floor lies over that of the world."""
        return self.low + self._climbed

    def follow(self, root: Array) -> float:
        """Go on to ``root`` (2,), and return the new level."""
        if self.terrain:
            gap = self._mean(root) - self.low
            self._pace += (_QUICK**2 * gap - 2 * _QUICK * self._pace) / FPS
            self.low += self._pace / FPS
            if abs(gap) < 1e-5 and abs(self._pace) < 1e-4:
                self.low, self._pace = self.low + gap, 0.0
        self._climbed = self._on_stairs(root)
        return self.level

    def goals(self, places: Array) -> Array:
        """Goals (N, 3) of the world as the walker's network is told them: what lies on the ground lies on its
        floor.
        """
        if not self.terrain and not self.stairs:
            return places
        ground = self.terrain.height(places[:, :2])
        if self.stairs:
            ground = np.maximum(ground, self.stairs.heights(places[:, :2]))
        on_ground = places[:, 2] <= ground + _ON_GROUND
        out = places.copy()
        out[:, 2] = np.where(on_ground, 0.0, places[:, 2] - self.level)
        return out

    def sensed(self, volume: InteractionVolume) -> InteractionVolume:
        """A sensed object as it is seen from the walker's floor."""
        if not self.level:
            return volume
        return replace(
            volume, centre=np.asarray(volume.centre) - np.array((0, 0, self.level), dtype=np.float32)
        )

    def seen(self, query: DistanceQuery) -> DistanceQuery:
        """Solids of the world, asked from the walker's floor."""
        return _Seen(query, self.level) if self.level else query

    def _on_stairs(self, root: Array) -> float:
        return float(self.stairs.level(np.asarray(root)[None, :2])[0]) if self.stairs else 0.0

    def _mean(self, root: Array) -> float:
        if not self.terrain:
            return 0.0
        return float(self.terrain.height(np.asarray(root, dtype=np.float64)[:2] + _ABOUT).mean())


class _Seen:
    """A query in a world that is shifted upward by ``level``."""

    def __init__(self, query: DistanceQuery, level: float) -> None:
        self.query, self.level = query, np.array((0, 0, level), dtype=np.float32)

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 of ``points`` (N, 3), heights over the walker's floor; see
        ``DistanceQuery``.
        """
        return self.query.signed_distance(np.asarray(points, dtype=np.float32) + self.level, max_distance)


__all__ = ["Relief"]
