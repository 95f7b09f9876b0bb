"""Learning rates over a run: one cosine, and AdamW's warm restarts (papers/000 section 3.3)."""

from __future__ import annotations

import math

LAST_RATE = 0.02  # share of the learning rate at the end of a run
CYCLES = (10, 20, 40)  # the paper's epochs between restarts; here shares of the whole run
FLOOR = 0.03
WARM_UP = 200


def cosine(share: float, floor: float = LAST_RATE) -> float:
    """Factor of the learning rate after a ``share`` 0..1 of a run: from 1 down to ``floor``, half a wave."""
    return floor + (1 - floor) * 0.5 * (1 + math.cos(math.pi * share))


def cosine_restarts(step: int, total: int) -> float:
    """Factor 0..1 of learning rate and decay at ``step`` of ``total``: cosine cycles in the ratio 1:2:4,
    short warm-up.
    """
    unit = total / sum(CYCLES)
    at = float(min(step, total - 1))
    for length in CYCLES:
        if at < length * unit:
            break
        at -= length * unit
    return cosine(at / (length * unit), FLOOR) * min(1.0, (step + 1) / WARM_UP)
