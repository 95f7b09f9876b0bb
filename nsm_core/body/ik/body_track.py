"""A body over a whole take, as what another one is kept out of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array

from .clearance import Obstacle

# Spheres of a body that others sense: they lie closer together than they are wide.
SENSED = slice(None, None, 2)


def spheres_distance(points: Array, centres: Array, radii: Array, most: float) -> Array:
    """Distances (N,) float32, at most ``most``, of ``points`` (N, 3) to the nearest of spheres (S, 3)."""
    out = np.full(len(points), most, dtype=np.float32)
    if not len(points):
        return out
    low, high = points.min(0) - most, points.max(0) + most
    near = ((centres + radii[:, None] > low) & (centres - radii[:, None] < high)).all(1)
    centres, radii = centres[near], radii[near]
    if not len(radii):
        return out
    reach = most + float(radii.max())
    close = np.flatnonzero(((points > centres.min(0) - reach) & (points < centres.max(0) + reach)).all(1))
    if not len(close):
        return out
    middle = centres.mean(0)  # sums of squares lose fewer digits near the origin
    p, c = points[close] - middle, centres - middle
    square = (p * p).sum(1)[:, None] - 2 * (p @ c.T) + (c * c).sum(1)
    out[close] = np.minimum(most, (np.sqrt(np.maximum(square, 0)) - radii).min(1))
    return out


@dataclass
class BodyTrack(Obstacle):
    """Another body over a take, as an obstacle: ``centres`` (T, S, 3) world and ``radii`` (T, S), metres; it
    stays as it is at its end.
    """

    centres: Array = None  # type: ignore[assignment]
    radii: Array = None  # type: ignore[assignment]
    first: int = 0  # frame that frame 0 of what is asked stands for

    def during(self, span: slice) -> BodyTrack:
        """The same over some of the frames."""
        return BodyTrack(self.query, None, None, self.centres, self.radii, self.first + span.start)

    def distance(self, frames: Array, points: Array, reach: float) -> Array:
        """Distances (N,), metres, at most ``reach``, of world ``points`` (N, 3) in ``frames`` (N,)."""
        out = np.full(len(points), reach)
        at = np.minimum(np.asarray(frames) + self.first, len(self.centres) - 1)
        order = np.argsort(at, kind="stable")
        ends = np.flatnonzero(np.diff(at[order])) + 1
        for rows in np.split(order, ends):
            if len(rows):
                t = int(at[rows[0]])
                out[rows] = spheres_distance(
                    points[rows].astype(np.float32), self.centres[t], self.radii[t], reach
                )
        return out


__all__ = ["SENSED", "BodyTrack", "spheres_distance"]
