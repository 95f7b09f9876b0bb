"""Heels rise on high seats: a thigh that would press into the seat's front edge is lifted by the foot under
it.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import LEGS, TOE_OFFSET
from nsm_core.body.skeleton import FEET, HIP_OVER_SEAT
from nsm_core.rotations import Array, quat_from_axis_angle, quat_mul, quat_rotate

from .two_bone import limb_frames, place_limbs

KNEE_OVER_SEAT = 0.05  # metres that a knee keeps over the level of the seat
MOST, SPEED, EASE = (
    0.08,
    0.008,
    0.3,
)  # metres an ankle is lifted at most; metres per frame and share by which that changes
_LEVER = float(np.hypot(*TOE_OFFSET[:2]))
_AXIS = np.array((1.0, 0.0, 0.0))


class Heels:
    """Lifts the heels of one sitter, smoothly; one call a frame."""

    def __init__(self) -> None:
        self.lift = np.zeros(2)

    def apply(
        self, hips_position: Array, local_rotations: Array, seated: float, hip_goal: Array | None
    ) -> Array:
        """Return new local rotations (23, 4).

        ``hips_position`` (3,) world metres, ``seated`` the sit label 0..1, ``hip_goal`` (3,) where the hips
        sit, None for nowhere.
        """
        if hip_goal is None and not self.lift.any():
            return local_rotations
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        joints, rotations, _ = limb_frames(hips, local, FEET)
        knees, toes, rotation = joints[:, 1], joints[:, 3], rotations[:, 2]
        wanted = np.zeros(2)
        if hip_goal is not None and seated > 0.3:
            wanted = np.clip(
                float(hip_goal[2]) - HIP_OVER_SEAT + KNEE_OVER_SEAT - knees[:, 2], 0, MOST
            ) * min(1.0, (seated - 0.3) / 0.5)
        self.lift += np.clip(EASE * (wanted - self.lift), -SPEED, SPEED)
        self.lift[self.lift < 1e-4] = 0
        if not self.lift.any():
            return local_rotations
        pitch = quat_from_axis_angle(_AXIS, np.arcsin(np.clip(self.lift / _LEVER, 0, 0.95)))
        feet = quat_mul(rotation, pitch)
        return place_limbs(hips, local, LEGS, toes - quat_rotate(feet, TOE_OFFSET), feet).astype(
            local_rotations.dtype
        )
