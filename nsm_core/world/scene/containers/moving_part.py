"""Parts of furniture that open: doors of cabinets, drawers, sliding doors, lids and flaps.

A house's door is a ``props.Leaf``, which people walk through and whose handle they keep; what opens here is
reached into.  Both are props: sensors, distances and scenes treat them alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, quat_from_axis_angle, quat_to_matrix, rotate_planar
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.scene.props import Prop, sense
from nsm_core.world.scene.wrist import WristPose, wrist_at

TURNING, SLIDING = ("hinged", "lid"), ("drawer", "sliding")


@dataclass
class MovingPart(Prop):
    """A part that turns about an axis or slides along it, from shut (0) to as far as it goes (1).

    Its frame, and so ``query`` and ``pose`` (4,), is that of the furniture it belongs to, as it is when the
    part is shut.  ``kind``: "hinged" about an upright axis, "lid" about a level one, "drawer" or "sliding"
    along the axis.  ``axis`` (3,) unit, ``pivot`` (3,) a point on it; ``travel`` radians or metres at opening
    1, right-handed about or along the axis; ``handle`` (3,) where a hand holds it when shut, ``away`` (3,)
    the unit way from there to the hand, ``bar`` (3,) that along the handle.
    """

    kind: str = "hinged"
    axis: Array = None  # type: ignore[assignment]
    pivot: Array = None  # type: ignore[assignment]
    travel: float = 0.0
    handle: Array = None  # type: ignore[assignment]
    away: Array = None  # type: ignore[assignment]
    bar: Array = None  # type: ignore[assignment]
    opening: float = 0.0

    @property
    def turns(self) -> bool:
        """Whether it turns about its axis rather than slides along it."""
        return self.kind in TURNING

    def motion(self, opening: float | None = None) -> tuple[Array, Array]:
        """Rotation (3, 3) and translation (3,) from where its points are when shut to where they are at an
        opening, the present one if None, in its frame.
        """
        amount = self.travel * (self.opening if opening is None else opening)
        if not self.turns:
            return np.eye(3), self.axis * amount
        turn = quat_to_matrix(quat_from_axis_angle(self.axis, amount))
        return turn, self.pivot - turn @ self.pivot

    def to_world(self, points: ArrayLike, pose: Array | None = None, opening: float | None = None) -> Array:
        """Points (..., 3) of the shut part in the world, at its present opening or another."""
        turn, shift = self.motion(opening)
        return super().to_world(np.asarray(points, dtype=np.float64) @ turn.T + shift, pose)

    def to_local(self, points: ArrayLike, pose: Array | None = None) -> Array:
        """World points (..., 3) where the shut part has them."""
        turn, shift = self.motion()
        return (super().to_local(points, pose) - shift) @ turn

    def grip(self, opening: float | None = None) -> WristPose:
        """The wrist's pose, world, that holds the handle at an opening, the present one if None."""
        turn, _ = self.motion(opening)
        towards, thumb = (
            rotate_planar(turn @ way, np.float64(self.pose[3])) for way in (-self.away, self._thumb())
        )
        return wrist_at(self.to_world(self.handle, opening=opening), towards, thumb)

    def _thumb(self) -> Array:
        """The thumb's side of a hand at the handle: along the bar, upwards or, of a level one, to its +X."""
        way: Array = self.bar - (self.bar @ self.away) * self.away
        return way if way @ (1e-3, 0.0, 1.0) > 0 else -way


def moving_part(
    name: str,
    kind: str,
    boxes: tuple[Array, Array] | DistanceQuery,
    bounds: tuple[Array, Array],
    axis: ArrayLike,
    pivot: ArrayLike,
    travel: float,
    handle: ArrayLike,
    away: ArrayLike = (0.0, -1.0, 0.0),
    bar: ArrayLike = (0.0, 0.0, 1.0),
) -> MovingPart:
    """Make a shut part at the origin of its furniture's frame.

    ``boxes`` its mins and maxs (M, 3) or another query; ``bounds`` corners (3,), (3,) of it; the rest as in
    ``MovingPart``.  Raises GeometryError on an unknown kind, an axis without length or no way to go.
    """
    if kind not in TURNING + SLIDING:
        raise GeometryError(f"Nothing opens as {kind!r}; choose one of {', '.join(TURNING + SLIDING)}.")
    line = np.asarray(axis, dtype=np.float64)
    length = float(np.linalg.norm(line))
    if not (np.isfinite(length) and length > 1e-9 and np.isfinite(travel) and travel > 0):
        raise GeometryError(f"{name} has no axis or no way to open; give both.")
    query = Cuboids([((0, 0, 0), 0.0, *boxes)]) if isinstance(boxes, tuple) else boxes
    low, high = (np.asarray(b, dtype=np.float64) for b in bounds)
    return MovingPart(
        name,
        query,
        sense(query, low, high),
        np.zeros(4),
        kind,
        line / length,
        np.asarray(pivot, dtype=np.float64),
        float(travel),
        np.asarray(handle, dtype=np.float64),
        np.asarray(away, dtype=np.float64),
        np.asarray(bar, dtype=np.float64),
    )
