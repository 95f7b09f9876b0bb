"""A character that is animated already: a body on its known way, among those that move by themselves."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.movers import Mover

from .ik.body_track import BodyTrack, spheres_distance
from .ik.clearance import Obstacle

_SWAYS = 0.08  # metres and radians by which a body stirs that stands or sits


class AnimatedBody(Mover):
    """The spheres ``centres`` (T, S, 3) and ``radii`` (S,), metres, that fill a body at 30 Hz from the take's
    first frame on, and its root ``poses`` (T, 4); see ``Mover``.
    """

    stirs = _SWAYS

    def __init__(
        self,
        name: str,
        centres: Array,
        radii: Array,
        poses: Array,
        parts: frozenset[str] = frozenset(),
        goes_on: bool = False,
    ) -> None:
        reach = float((np.linalg.norm(centres[..., :2] - poses[:, None, :2], axis=2) + radii).max())
        super().__init__(name, Cuboids(), poses, reach, parts, goes_on)
        self.centres, self.radii = centres.astype(np.float32), radii.astype(np.float32)

    def distance_at(self, frame: int, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 of ``points`` (N, 3) to where it is in a frame."""
        at = min(max(frame, 0), len(self.centres) - 1)
        return spheres_distance(
            np.asarray(points, dtype=np.float32), self.centres[at], self.radii, max_distance
        )

    def obstacle(self) -> Obstacle:
        """The body over a take, as the solver knows it."""
        radii = np.broadcast_to(self.radii, self.centres.shape[:2])
        return BodyTrack(self.query, None, None, self.centres, radii)


def obstacle_of(mover: Mover, count: int) -> Obstacle:
    """Something that moves by itself over the ``count`` frames of a take, as the solver knows it."""
    return mover.obstacle() if isinstance(mover, AnimatedBody) else Obstacle(mover.query, mover.track(count))


__all__ = ["AnimatedBody", "obstacle_of"]
