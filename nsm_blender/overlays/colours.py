"""The colours of the overlays: orange is what the character sees from itself, blue from its goal."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array

SOLID, SOLID_EDGE = (0.95, 0.45, 0.20, 0.16), (0.95, 0.45, 0.20, 0.75)
WALKED_ON, WALKED_ON_EDGE = (0.35, 0.75, 0.45, 0.16), (0.35, 0.75, 0.45, 0.7)
WAY = (1.0, 0.82, 0.25, 0.95)
GOAL, LOST = (0.35, 0.85, 0.45, 1.0), (0.95, 0.25, 0.20, 1.0)
EGOCENTRIC, GOALWARD = (1.0, 0.60, 0.15, 1.0), (0.30, 0.65, 1.0, 1.0)
GONE = (0.92, 0.92, 0.92, 0.55)
CONTACT, FREE = (0.20, 0.90, 0.45, 1.0), (0.75, 0.75, 0.75, 0.45)
NOTHING = (0.45, 0.55, 0.85, 0.30)
VOLUME_EDGE = (0.30, 0.65, 1.0, 0.8)
PLATE, PLATE_TEXT = (0.08, 0.08, 0.09, 0.72), (0.92, 0.92, 0.92, 1.0)
# Of the experts, one after the other.
EXPERTS = (
    (0.35, 0.61, 0.87), (0.96, 0.62, 0.25), (0.42, 0.74, 0.43), (0.87, 0.40, 0.40), (0.66, 0.52, 0.84),
    (0.69, 0.52, 0.42), (0.91, 0.57, 0.78), (0.62, 0.62, 0.62), (0.80, 0.78, 0.35), (0.37, 0.79, 0.83),
)  # fmt: skip

_RAMP = np.array(((0.15, 0.35, 0.85), (0.20, 0.80, 0.75), (0.95, 0.80, 0.25), (0.92, 0.22, 0.15)))


def occupied(values: Array, least: float = 0.25) -> Array:
    """Colours (N, 4) of occupancies (N,) in 0..1, from blue to red, the fuller the less see-through."""
    values = np.clip(np.asarray(values, np.float64), 0, 1)
    at = values * (len(_RAMP) - 1)
    low = np.minimum(at.astype(int), len(_RAMP) - 2)
    share = (at - low)[:, None]
    rgb = _RAMP[low] * (1 - share) + _RAMP[low + 1] * share
    return np.column_stack((rgb, least + (1 - least) * values)).astype(np.float32)
