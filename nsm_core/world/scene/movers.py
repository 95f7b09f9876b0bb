"""Things that move by themselves, as somebody has animated them: their places are known ahead."""

from __future__ import annotations

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery

_STAYS, _STIRS = 2 * FPS, 0.02  # frames ahead for which it stays, and metres or radians that are no move


class Mover:
    """One animated thing that stays upright: an ``Other`` of a take's scene.

    ``query`` its solids in its own frame, ``poses`` (T, 4) of that frame at 30 Hz from the take's first frame
    on, the last of them held: x, y, z (metres) and heading; ``reach`` metres on the floor from its place
    within which all of it lies; ``parts`` the names of the objects that it consists of; ``goes_on`` whether
    it moves on after the last of the poses.
    """

    stirs = _STIRS

    def __init__(
        self,
        name: str,
        query: DistanceQuery,
        poses: Array,
        reach: float,
        parts: frozenset[str] = frozenset(),
        goes_on: bool = False,
    ) -> None:
        self.name, self.query, self.reach, self.parts, self.goes_on = name, query, reach, parts, goes_on
        self.poses = np.asarray(poses, dtype=np.float64)
        self.frame = 0

    @property
    def pose(self) -> Array:
        """Where it is now (4,)."""
        return self.pose_at(self.frame)

    def pose_at(self, frame: int) -> Array:
        """Where it is in a frame (4,)."""
        return self.poses[min(max(frame, 0), len(self.poses) - 1)]

    def track(self, count: int) -> Array:
        """Its poses (count, 4) from the take's first frame on."""
        return self.poses[np.minimum(np.arange(count), len(self.poses) - 1)]

    @property
    def settled(self) -> bool:
        """Whether it stays where it is for a while."""
        return self.rests(self.frame)

    def rests(self, frame: int) -> bool:
        """Whether it stays where it is in a frame for a while."""
        if self.goes_on and frame + _STAYS > len(self.poses):
            return False
        ahead = self.poses[max(frame, 0) : frame + _STAYS]
        return not len(ahead) or bool(np.abs(ahead - self.pose_at(frame)).max() < self.stirs)

    def at_rest_from(self, frame: int) -> int | None:
        """The first frame from ``frame`` on in which it rests for a while; None where it never does."""
        return next((t for t in range(frame, max(frame, len(self.poses)) + 1) if self.rests(t)), None)

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 of world ``points`` (N, 3) to where it is now; see ``DistanceQuery``."""
        return self.distance_at(self.frame, points, max_distance)

    def distance_at(self, frame: int, points: Array, max_distance: float) -> Array:
        """The same to where it is in a frame."""
        pose = self.pose_at(frame)
        own = rotate_planar(np.asarray(points, dtype=np.float64) - pose[:3], np.float64(-pose[3]))
        return self.query.signed_distance(own.astype(np.float32), max_distance)


__all__ = ["Mover"]
