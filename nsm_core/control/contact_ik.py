"""Feet that stay where they land and hips that settle on a seat: detection, whole takes, frame by frame."""

from __future__ import annotations

import numpy as np

from ..conventions import FPS
from ..rotations import Array
from ..skeleton import FEET

ANKLES, TOES = [foot[2] for foot in FEET], [foot[3] for foot in FEET]


def detect_foot_contacts(positions: Array, height: float = 0.045, speed: float = 0.3, window: int = 5, fps: float = FPS) -> Array:
    """Tell which feet stand: (T, 2) bool, right and left, from world joint positions (T, 23, 3), metres.

    A foot stands where its toe joint is lower than ``height`` metres and horizontally slower than ``speed`` metres a second,
    after a majority vote over ``window`` frames that removes flicker.
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
