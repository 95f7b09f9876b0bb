"""What becomes of sensor readings where the world is reflected left to right."""

from __future__ import annotations

import numpy as np

from nsm_core.world.sensors.environment import ENVIRONMENT_POINTS
from nsm_core.world.sensors.interaction import UNIT_CELLS


def _partners(points: np.ndarray) -> np.ndarray:
    """Of each point (N, 3) the number of the one where its reflection lies."""
    away = np.linalg.norm((points * (-1, 1, 1))[:, None] - points, axis=-1)
    assert away.min(1).max() < 1e-5, "a point is reflected to where none is"
    return away.argmin(1)


# environment[ENVIRONMENT_MIRROR] is the reading in the reflected world.
ENVIRONMENT_MIRROR = _partners(ENVIRONMENT_POINTS)
# occupancy[INTERACTION_MIRROR] is that of an object reflected in its own frame.
INTERACTION_MIRROR = _partners(UNIT_CELLS)
