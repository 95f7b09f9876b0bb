"""Captured pieces are put where the motion before them ends."""

from __future__ import annotations

import numpy as np

from nsm_core.body.clip import transform
from nsm_core.rotations import Array


def put_on_roots(
    hips: Array, rotations: Array, root: Array, heading: Array, to_root: Array, to_heading: Array
) -> tuple[Array, Array]:
    """Move frames (T, ...) rigidly so that their roots (T, 2), (T,) come to lie on other roots."""
    turn = (to_heading - heading).astype(hips.dtype)
    moved = hips.copy()
    moved[:, :2] -= root
    hips, rotations = transform(moved, rotations, to_root, turn)
    return hips.astype(np.float32), rotations.astype(np.float32)
