"""In which manner one sits: where the hands lie, when they come there and leave, and how the trunk leans.

A goal draws one manner from its take's seed, out of the same ranges from which training data are composed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.ik.thighs import ALONG_THIGH, EARLY, LAP, LATE, LEAN_ON_HANDS, OFF_THIGH, SEATED_LEAN
from nsm_core.rotations import Array


@dataclass(frozen=True)
class SeatedManner:
    """``hands``: whether they are laid down, else they are as the network has them; in the ``lap`` or each on
    its thigh, at ``place``, see ``on_thighs``.  ``down`` and ``up`` are the seatedness over which they come
    there and leave; ``lean`` radians of the seated trunk, ahead.  ``rests``: places (3,) of the wrists on arm
    rests, world, right and left, None on a side without one.
    """

    hands: bool
    lap: bool
    place: tuple[float, float]
    down: tuple[float, float]
    up: tuple[float, float]
    lean: float
    rests: tuple[Array | None, Array | None] = (None, None)


def draw_seated(
    rng: np.random.Generator, hands: bool, rests: Sequence[Array | None] = (None, None)
) -> SeatedManner:
    """Draw a manner; ``hands``: whether they are free to lie down, on ``rests`` where there are any."""
    down, up = (EARLY if rng.random() < LEAN_ON_HANDS else LATE for _ in range(2))
    return SeatedManner(
        hands,
        bool(rng.random() < LAP),
        (float(rng.uniform(*ALONG_THIGH)), float(rng.uniform(*OFF_THIGH))),
        down,
        up,
        float(rng.uniform(*SEATED_LEAN)),
        (rests[0], rests[1]),
    )


__all__ = ["SeatedManner", "draw_seated"]
