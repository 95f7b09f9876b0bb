"""Learning rate and weight decay: AdamW with warm restarts (papers/000 section 3.3)."""

from __future__ import annotations

import math

CYCLES = (10, 20, 40)  # the paper's epochs between restarts; here shares of the whole run
FLOOR = 0.03
WARM_UP = 200


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
    factor = FLOOR + (1 - FLOOR) * 0.5 * (1 + math.cos(math.pi * at / (length * unit)))
    return factor * min(1.0, (step + 1) / WARM_UP)
