"""Whether a motion on other objects is as sound as it was: what is allowed to become worse, and by
how much.
"""

from __future__ import annotations

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Cuboids

# Metres: of the body in things by more than before; of hips and feet from their places.
DEEPER, ASTRAY = 0.02, 0.015
# Speed and acceleration of joints may grow by this factor, or to this (m/s, m/s^2) more.
FASTER, SLACK = 1.3, (0.3, 12.0)
AROUND = FPS + 5  # frames on either side of an interaction that a transfer changes


def depth_in_solids(body: tuple[Array, Array], solid: Cuboids) -> float:
    """How deep, metres, spheres of the body, centres (n, S, 3) and radii (S,), reach into a solid at most."""
    centres, radii = body
    distance = solid.signed_distance(centres.reshape(-1, 3).astype(np.float32), 0.15).reshape(
        centres.shape[:2]
    )
    return float(np.maximum(radii - distance, 0).max(initial=0.0))


def no_faster(joints: Array, before: Array) -> bool:
    """Whether joints (T, J, 3), metres, reach no clearly greater speed or acceleration than they did
    ``before``.
    """
    for order, slack in zip((1, 2), SLACK, strict=True):
        old, new = (
            np.linalg.norm(np.diff(j, order, axis=0), axis=-1).max() * FPS**order for j in (before, joints)
        )
        if new > max(FASTER * old, old + slack):
            return False
    return True
