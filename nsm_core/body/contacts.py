"""Where feet touch the ground: soles, their contacts and their headings."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.rotations import Array, direction_to_heading, quat_rotate

from .skeleton import ANKLE_HEIGHT, FEET, OFFSETS, TOE_HEIGHT

ANKLES, TOES = [foot[2] for foot in FEET], [foot[3] for foot in FEET]
# The toe joint is never lower than this over the floor, metres (the reference code's clamp).
TOE_CLEARANCE = 0.02
RESTING = 0.3  # m/s of a toe joint that still counts as standing
LEGS = (FEET[0][:3], FEET[1][:3])
TOE_OFFSET = OFFSETS[TOES[0]].astype(np.float64)
# Underside of the heel in the foot's rest frame, from the ankle joint, and seen from the toe joint.
HEEL_FROM_ANKLE = np.array((0, 0.05, -ANKLE_HEIGHT))
HEEL_FROM_TOE = HEEL_FROM_ANKLE - TOE_OFFSET
_AHEAD = np.array((0.0, -1.0, 0.0))


def detect_foot_contacts(
    positions: Array, height: float = 0.07, speed: float = RESTING, window: int = 5, fps: float = FPS
) -> Array:
    """Tell which feet stand: (T, 2) bool, right and left, from world joint positions (T, 23, 3), metres.

    A foot stands where its toe joint is lower than ``height`` metres and horizontally slower than ``speed``
    metres a second,
    after a majority vote over ``window`` frames that removes flicker.  The speed tells a swing; the height is
    generous because a foot that pushes off carries its toe joint up to 7 cm high in some captures.
    """
    toes = positions[:, TOES]
    velocity = np.zeros(toes.shape[:2] + (2,), dtype=np.float64)
    if len(toes) > 1:
        velocity = np.gradient(toes[..., :2].astype(np.float64), axis=0) * fps
    on = (toes[..., 2] < height) & (np.linalg.norm(velocity, axis=-1) < speed)
    half = window // 2
    padded = np.pad(on.astype(np.int32), ((half, half), (0, 0)), mode="edge")
    votes = np.stack([padded[i : i + len(on)] for i in range(2 * half + 1)]).sum(0)
    return votes > half


@dataclass(frozen=True, eq=False)
class Sole:
    """The soles of a character: ``toe`` (3,) its toe joint in the rest frame of the ankle, ``heel`` (3,) the
    underside of the heel seen from the toe joint, ``toe_height`` that of the toe joint over a floor it stands
    on; metres.  ``tip`` (3,) is the underside of the tip of a foot that has no toes of its own to bend, seen
    from the toe joint; None where toes give way.
    """

    toe: Array = field(default_factory=lambda: TOE_OFFSET)
    heel: Array = field(default_factory=lambda: HEEL_FROM_TOE)
    toe_height: float = TOE_HEIGHT
    tip: Array | None = None

    @property
    def ankle_height(self) -> float:
        """Of the ankle joint over a floor it stands on, metres."""
        return float(self.toe_height - self.toe[2])

    @classmethod
    def of(cls, offsets: Array) -> Sole:
        """Those of a character with joints at ``offsets`` (23, 3) that stands on its soles in the
        rest pose.
        """
        offsets = np.asarray(offsets, dtype=np.float64)
        toe = offsets[TOES].mean(0) * (0, 1, 1)
        ankle = float(sum(offsets[[leg[k] for leg in FEET], 2].mean() for k in range(3)) + offsets[0, 2])
        size = float(np.hypot(*toe[1:]) / np.hypot(*TOE_OFFSET[1:]))
        heel = np.array((0.0, size * HEEL_FROM_ANKLE[1], -ankle)) - toe
        return cls(toe, heel, float(ankle + toe[2]))

    def depth(
        self, toes: Array, feet: Array, ground: Array | float = 0.0, heel_ground: Array | float | None = None
    ) -> Array:
        """How far (...) feet reach under the ground, metres, at least 0: toe joints (..., 3) world, ankle
        rotations (..., 4) world.  ``ground`` is its height (...) under the foot, ``heel_ground`` that under
        the heel where it differs.
        """
        heel = quat_rotate(feet, self.heel)[..., 2]
        under = ground if heel_ground is None else heel_ground
        least = self.toe_height - (TOE_HEIGHT - TOE_CLEARANCE)
        deep = np.maximum(least - (toes[..., 2] - ground), -(toes[..., 2] - under + heel))
        if self.tip is not None:
            deep = np.maximum(deep, -(toes[..., 2] - ground + quat_rotate(feet, self.tip)[..., 2]))
        return np.maximum(0, deep)


def foot_heading(feet: Array) -> Array:
    """Heading (...) of feet from their ankles' world rotations (..., 4)."""
    return direction_to_heading(quat_rotate(feet, _AHEAD))
