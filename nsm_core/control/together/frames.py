"""Where a character's own world lies in the one that all share: each acts in a world of its own scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery


@dataclass(frozen=True)
class Frame:
    """A character's world in the common one: ``scale`` common metres to one of its own, ``floor`` the height
    of its floor, common metres.
    """

    scale: float = 1.0
    floor: float = 0.0

    def to_common(self, points: Array) -> Array:
        """Own points (..., 2 or 3) in the common world."""
        points = np.asarray(points, dtype=np.float64)
        return points * self.scale + (0.0, 0.0, self.floor)[: points.shape[-1]]

    def to_own(self, points: Array) -> Array:
        """Common points (..., 2 or 3) in the character's world."""
        points = np.asarray(points, dtype=np.float64)
        return (points - (0.0, 0.0, self.floor)[: points.shape[-1]]) / self.scale

    def pose_from(self, other: Frame, pose: Array) -> Array:
        """Poses (..., 4) of another character's world in this one: x, y, z and heading."""
        if other == self:
            return np.array(pose, dtype=np.float64)
        pose = np.asarray(pose, dtype=np.float64)
        return np.concatenate((self.to_own(other.to_common(pose[..., :3])), pose[..., 3:]), axis=-1)


@dataclass(frozen=True)
class Scaled:
    """Solids of a world in which they are ``ratio`` times as large."""

    query: DistanceQuery
    ratio: float

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 of ``points`` (N, 3); see ``DistanceQuery``."""
        found = self.query.signed_distance(
            (np.asarray(points) / self.ratio).astype(np.float32), max_distance / self.ratio
        )
        return np.asarray(found * self.ratio, dtype=np.float32)
