"""What a hand does, by number (table 2 of papers/002, of which a way to a thing and back is all here)."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array

FREE, APPROACHES, HOLDS, LEAVES = range(4)
TASKS = 4


def labels_of(walk: Array, tasks: Array) -> Array:
    """Labels (T, LABELS) of the key joints: ``walk`` (T,) of the hips, ``tasks`` (T, 2) of both hands."""
    hands = np.eye(TASKS, dtype=np.float32)[np.asarray(tasks, dtype=int)].reshape(len(walk), -1)
    return np.concatenate((np.asarray(walk, dtype=np.float32)[:, None], hands), axis=1)
