"""Toes of who lifts a box or sets it down stay out of it, and out of what it stands on: a foot that stands
too far ahead comes back.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import LEGS
from nsm_core.body.skeleton import END_SITES, FEET, JOINTS
from nsm_core.rotations import Array, quat_rotate
from nsm_core.world.geometry.distance import DistanceQuery

from .two_bone import limb_frames, place_limbs

FURTHEST, EASE, SPEED = (
    0.14,
    0.3,
    0.012,
)  # metres a foot is brought back at most; share and metres a frame by which that changes
MARGIN = 0.01  # metres between a shoe and what is before it
_TIP = np.array(END_SITES[JOINTS[FEET[0][3]]], dtype=np.float64)
_ALONG = np.array((0.0, 0.5, 1.0))  # from the joint of the toes to their tips
_RADIUS = 0.025


class ToeClearance:
    """Brings the feet of one character back from what is before their toes, smoothly; one call a frame."""

    def __init__(self) -> None:
        self.back = np.zeros(2)

    def apply(self, hips_position: Array, local_rotations: Array, query: DistanceQuery | None) -> Array:
        """Return new local rotations (23, 4); ``hips_position`` (3,) world metres.  ``query`` None: nothing
        is to be kept out of.
        """
        if query is None and not self.back.any():
            return local_rotations
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        joints, rotations, _ = limb_frames(hips, local, FEET)
        ankles, toes, feet = joints[:, 2], joints[:, 3], rotations[:, 2]
        tips = quat_rotate(rotations[:, 3], _TIP)
        way = tips * (1.0, 1.0, 0.0)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        wanted = -self.back
        if query is not None:
            points = toes[:, None] + _ALONG[:, None] * tips[:, None] - (self.back[:, None] * way)[:, None]
            distance = (
                query.signed_distance(points.reshape(-1, 3).astype(np.float32), 0.1).reshape(2, -1).min(1)
            )
            wanted = _RADIUS + MARGIN - distance.astype(np.float64)
        self.back = np.clip(self.back + np.clip(EASE * wanted, -SPEED, SPEED), 0, FURTHEST)
        self.back[self.back < 1e-4] = 0
        if not self.back.any():
            return local_rotations
        return place_limbs(hips, local, LEGS, ankles - self.back[:, None] * way, feet).astype(
            local_rotations.dtype
        )


__all__ = ["ToeClearance"]
