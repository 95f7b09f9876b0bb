"""What feeling the ground is worth: the same gaps over uneven ground, filled with their own ground felt, with
level ground, and with that of another gap (papers/001 table 3 asks it of networks trained with and without).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import HIPS, TOE_HEIGHT
from nsm_core.data.transitions.gaps import Gaps
from nsm_core.data.transitions.windows import Windows
from nsm_core.model.networks.gap_torch import GapNetwork
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES
from nsm_core.rotations import Array

from .measures import errors
from .tables import Judge

FRAMES = (30, 60)
UNEVEN = 0.1  # metres between the lowest and the highest ground that the hips go over
OWN, LEVEL, OTHER = "its own", "level", "another's"


@dataclass(frozen=True)
class Felt:
    """``mse`` and centimetres ``off`` as in the tables; ``inside``: centimetres that a toe is in the true
    ground at most, mean over gaps; ``gaps``: how many.
    """

    mse: float
    off: float
    inside: float
    gaps: int


def felt(judge: Judge, net: GapNetwork) -> dict[str, dict[str, Felt]]:
    """By frames missing and by the ground that the network feels."""
    out: dict[str, dict[str, Felt]] = {}
    for frames in FRAMES:
        uneven = _uneven(judge.windows, frames)
        if not uneven.size:
            continue
        gaps, own = judge.gaps(frames, uneven), judge.seen(net, frames, uneven)
        out[str(frames)] = {}
        for name, sampled in _grounds(own).items():
            joints = judge.told(net, replace(own, sampled=sampled), gaps)
            found = errors(gaps, joints, judge.mean, judge.deviation)
            toes = joints[:, :-1, TOES]
            ground = gaps.heights(toes[..., :2].reshape(len(toes), -1, 2)).reshape(toes.shape[:3])
            depth = np.maximum(ground + TOE_HEIGHT - toes[..., 2], 0).max((1, 2))
            out[str(frames)][name] = Felt(found.mse, found.aco, 100 * float(depth.mean()), len(joints))
    return out


def _uneven(windows: Windows, frames: int) -> Array:
    """Windows of actors held out in which the ground under the hips is UNEVEN while a gap is missing."""

    def relief(n: int) -> float:
        first = windows.start[n] + PAST
        way = windows.hips[first : first + frames, :2]
        return float(np.ptp(windows.grounds[n, 0].height(windows.maps, way)))

    chosen = windows.chosen(True, PAST + frames + TARGET_FRAMES)
    return chosen[[relief(n) > UNEVEN for n in chosen]]


def _grounds(gaps: Gaps) -> dict[str, Callable[[Array], Array]]:
    """Grounds (B, N) at places (B, N, 2): as they are; as high everywhere as where the gap begins; and each
    gap that of another, as high where it begins as its own.
    """
    begin = gaps.sampled(gaps.joints[:, PAST - 1, None, HIPS, :2])
    order = np.roll(np.arange(len(gaps.first)), len(gaps.first) // 2)
    back = np.argsort(order)

    def other(places: Array) -> Array:
        return gaps.sampled(places[back])[order] - begin[order] + begin

    return {
        OWN: gaps.sampled,
        LEVEL: lambda places: np.broadcast_to(begin, places.shape[:2]),
        OTHER: other,
    }


def text(found: Mapping[str, Mapping[str, Felt]]) -> str:
    """As text."""
    lines = ["Over uneven ground, by the ground that is felt"]
    lines.append(f"{'':22s}{'MSE':>8s}{'cm off':>8s}{'cm in the ground':>18s}{'gaps':>6s}")
    for frames, rows in found.items():
        for name, row in rows.items():
            lines.append(
                f"{frames:>3s} frames, {name:11s}{row.mse:8.3f}{row.off:8.2f}{row.inside:18.2f}{row.gaps:6d}"
            )
    return "\n".join(lines)


__all__ = ["Felt", "felt", "text"]
