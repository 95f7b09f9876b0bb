"""Rule for what is none of the actions: hops, crouches, bows and gestures that no walk should be stitched
from.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.conventions import FPS
from nsm_core.signals import intervals

from .measures import MeasuredMotion, Span, closed

_CHEST = INDEX["Chest4"]
_SHOULDERS, _WRISTS = (
    [INDEX[s + "Shoulder"] for s in ("Right", "Left")],
    [INDEX[s + "Wrist"] for s in ("Right", "Left")],
)
_AIRBORNE = (
    0.048  # metres over the ground of the lower toe joint: captured walks stay under 4.7 cm, skips do not
)
_SLOWER = 1.9  # m/s: below it no step leaves the floor, and turns do not lean
_LEAPT = 1.0  # metres of the hips over the ground that neither walks nor runs reach
# Metres of the hips over the ground, lean of the trunk; slower and faster.
_CROUCHED, _TILT = (0.8, 0.65), np.radians((35, 55))
_APART = round(0.7 * FPS)  # frames between two such moments that belong to them


def others(motion: MeasuredMotion, spans: list[Span]) -> list[tuple[int, float]]:
    """Key frames of "other" where a body neither sits, carries, opens nor climbs (``spans``), and does not
    just walk or run.
    """
    p = motion.positions
    lower = p[:, TOES, 2].min(1)
    nearby = np.pad(lower, 15, mode="edge")
    ground = np.lib.stride_tricks.sliding_window_view(nearby, 31).min(1)
    slow = motion.speed < _SLOWER
    height = p[:, HIPS, 2] - ground
    flies = ((lower > ground + _AIRBORNE) & slow) | (height > _LEAPT)
    crouches = height < np.where(slow, *_CROUCHED)
    trunk = p[:, _CHEST] - p[:, HIPS]
    leans = np.arctan2(np.linalg.norm(trunk[:, :2], axis=1), trunk[:, 2]) > np.where(slow, *_TILT)
    raised = (p[:, _WRISTS, 2] > p[:, _SHOULDERS, 2] + 0.05).any(1)
    odd = flies | crouches | leans | raised
    for span in spans:
        odd[span.start : span.end + 1] = False
    keys: dict[int, float] = {}
    last = len(motion) - 1
    for a, b in intervals(closed(odd, _APART)):
        if b - a < 2:
            continue
        keys |= {max(a - 8, 0): 0.0 if a > 8 else 1.0, max(a - 2, 0): 1.0}
        keys |= {min(b + 2, last): 1.0, min(b + 8, last): 0.0 if b + 8 < last else 1.0}
    return sorted(keys.items())
