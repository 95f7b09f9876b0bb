"""Keep the back of a sitter out of the back rest: the trunk leans forward from the lowest joint of
the spine.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import BACK_FROM, BACK_RADIUS, INDEX, OFFSETS
from nsm_core.rotations import Array, quat_from_axis_angle, quat_mul, quat_rotate
from nsm_core.world.geometry.distance import DistanceQuery

from .two_bone import chain_frames

_CHEST = INDEX["Chest"]
_SPINE = (INDEX["Chest2"], INDEX["Chest3"], INDEX["Chest4"])
_SHARES = np.linspace(0, 1, 4)
MOST_LEAN, EASE, SPEED = (
    np.radians(22),
    0.25,
    np.radians(1.2),
)  # lean at most; share and angle per frame by which it changes
_STEP = 0.02  # metres between the samples of the distance's slope


class TrunkClearance:
    """Leans the trunk off what stands behind it, smoothly; stateful, one character, one call a frame."""

    def __init__(self, query: DistanceQuery) -> None:
        self.query = query
        self.lean = 0.0

    def apply(self, hips_position: Array, local_rotations: Array, seated: float) -> Array:
        """Return new local rotations (23, 4) of a pose; ``hips_position`` (3,) world metres, ``seated`` the
        sit label 0..1.
        """
        local = local_rotations.astype(np.float64)
        wanted = (
            self._needed(hips_position.astype(np.float64), self._leant(local), local[0])
            if seated > 0.3
            else -self.lean
        )
        self.lean = float(np.clip(self.lean + np.clip(EASE * wanted, -SPEED, SPEED), 0, MOST_LEAN))
        return (
            self._leant(local).astype(local_rotations.dtype) if self.lean > 1e-4 else local_rotations.copy()
        )

    def _leant(self, local: Array) -> Array:
        """The pose with the chest pitched forward, about its own side-to-side axis, by the present lean."""
        turned = local.copy()
        turned[_CHEST] = quat_mul(
            quat_from_axis_angle(np.array((1.0, 0, 0)), np.asarray(self.lean)), local[_CHEST]
        )
        return turned

    def _needed(self, hips: Array, local: Array, pelvis: Array) -> float:
        """Radians to lean further forward (negative: back) so that the back just touches what is
        behind it.
        """
        position, rotation = chain_frames(hips, local, (_SPINE[0],))
        pivot = chain_frames(hips, local, (_CHEST,))[0][0]
        points = [position[0]]
        for before, joint in zip(_SPINE[:-1], _SPINE[1:], strict=True):
            rotation = quat_mul(rotation, local[[before]])
            points.append(points[-1] + quat_rotate(rotation, OFFSETS[[joint]].astype(np.float64))[0])
        spine = np.concatenate([points[k] + _SHARES[:, None] * (points[k + 1] - points[k]) for k in range(2)])
        levers = np.linalg.norm(spine - pivot, axis=1)
        spine, levers = spine[levers > BACK_FROM], levers[levers > BACK_FROM]
        distance = self.query.signed_distance(spine.astype(np.float32), BACK_RADIUS + 0.05).astype(np.float64)
        depth = BACK_RADIUS - distance
        deepest = int(depth.argmax())
        if depth[deepest] > 0:
            forward = quat_rotate(pelvis[None], np.array(((0.0, -1.0, 0.0),)))[0]
            ends = np.stack((spine[deepest] + _STEP * forward, spine[deepest] - _STEP * forward)).astype(
                np.float32
            )
            ahead, behind = self.query.signed_distance(ends, BACK_RADIUS + 0.05)
            if (
                ahead <= behind
            ):  # what it touches stands before the body or at its side: leaning would not help
                return -self.lean
        return float(depth[deepest] / levers[deepest])


__all__ = ["TrunkClearance"]
