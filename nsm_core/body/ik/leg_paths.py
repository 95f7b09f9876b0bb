"""Legs of a finished take that still pass through what is climbed: their ways are bent clear with what comes
before and after in view.

``LegClearance`` sees one frame and gives way late; here all frames about a pass are solved together: what the
legs are in, by how much the pose is changed, and how fast that changes are weighed against one another.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nsm_core.rotations import Array
from nsm_core.signals import intervals
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.terrain import Terrain

from .leg_clearance import CLIMBING, STIFF, LegClearance, LegPose

AROUND = 15  # frames before and after a pass over which the pose may change
LONGEST, AT_ONCE = 100, 4  # frames that are solved together at most, and between two looks elsewhere
ROUNDS = 5
MARGIN, LEAST_DEEP = 0.012, 0.004  # metres that the flesh keeps off, and that it must be in something
LEAST = np.array((-0.12, -0.12, -0.05, 0.0, 0.0, 0.0, 0.0))
MOST = np.array((0.12, 0.12, 0.12, 0.15, 0.15, 0.3, 0.3))
SMOOTH = 8.0  # how dear a metre of change of pace between two frames is, as against a metre in the solid
STIFFNESS = 0.3  # share of the stiffness of a single frame


class LegPaths:
    """Bends the legs' ways of one take."""

    def __init__(self, query: DistanceQuery, terrain: Terrain | None = None) -> None:
        """As ``LegClearance``."""
        self._legs = LegClearance(query, terrain, MARGIN, feet=True)

    def clear(self, hips: Array, local: Array, locked: Array, climbing: Array) -> Iterator[None]:
        """Change hips (T, 3) and local rotations (T, 23, 4) in place, a few frames at a time: yields between.

        ``locked`` (T, 2) feet stay where they are, and all feet keep their turn; looked at is where the climb
        label ``climbing`` (T,) is up.
        """
        deep, near = np.zeros(len(hips), bool), _spread(climbing >= CLIMBING)
        for n, t in enumerate(np.flatnonzero(near)):
            deep[t] = (
                self._legs.depth(LegPose(hips[t].astype(np.float64), local[t].astype(np.float64)))
                > MARGIN + LEAST_DEEP
            )
            if n % AT_ONCE == AT_ONCE - 1:
                yield
        if not deep.any():
            return
        for first, last in intervals(_spread(deep)):
            for start in range(first, last, LONGEST):
                yield from self._bend(hips, local, locked, start, min(last, start + LONGEST))

    def _bend(self, hips: Array, local: Array, locked: Array, first: int, last: int) -> Iterator[None]:
        """Gauss and Newton over the changes (T, 7) of the frames from ``first`` to ``last``, which fade to
        none at both ends.
        """
        poses = [LegPose(hips[t].astype(np.float64), local[t].astype(np.float64)) for t in range(first, last)]
        count, own = len(poses), np.arange(7)
        change = np.zeros((count, 7))
        stiff = np.tile(STIFFNESS * STIFF**2, (count, 1))
        stiff[:, 5:] += 1e3 * locked[first:last]
        bend = _bending(count)
        smooth = SMOOTH**2 * np.kron(bend.T @ bend, np.eye(7))
        for _ in range(ROUNDS):
            system, side = smooth.copy(), -(smooth @ change.ravel()) - (stiff * change).ravel()
            for t, pose in enumerate(poses):
                miss, slope = self._legs.misses_and_slope(pose, change[t])
                at = 7 * t + own
                system[np.ix_(at, at)] += slope.T @ slope + np.diag(stiff[t])
                side[at] -= slope.T @ miss
                if t % AT_ONCE == AT_ONCE - 1:
                    yield
            change = np.clip(change + np.linalg.solve(system, side).reshape(count, 7), LEAST, MOST)
        for t, pose in enumerate(poses):
            h, r = pose.changed(change[t][None])
            hips[first + t], local[first + t] = h[0], r[0]


def _spread(flags: Array) -> Array:
    """Flags (T,) that are set within ``AROUND`` frames."""
    return np.convolve(flags, np.ones(2 * AROUND + 1))[AROUND : AROUND + len(flags)] > 0.5


def _bending(count: int) -> Array:
    """Second differences (count + 2, count) of what is zero before and after."""
    out = np.zeros((count + 2, count))
    for k, weight in ((0, 1.0), (1, -2.0), (2, 1.0)):
        out[np.arange(count) + k, np.arange(count)] = weight
    return out


__all__ = ["LegPaths"]
