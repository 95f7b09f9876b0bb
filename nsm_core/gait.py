"""Whether a walk is played at the speed it was walked at: what gravity says of stride length and pace."""

from __future__ import annotations

import numpy as np

from .clip import Clip
from .conventions import FPS
from .rotations import Array, heading_to_direction
from .skeleton import FEET, HIPS, OFFSETS

_LEG = float(-OFFSETS[list(FEET[0][1:3]), 2].sum())
_GRAVITY = 9.81
_APART = 0.12  # metres that the ankles pass each other by for a step to count
_STRIDES = (0.5, 3.0)  # legs' lengths of strides that are walked
_LEAST_STRIDES = 2
_PLAUSIBLE = (0.45, 2.2)  # of the pace that the strides ask for
_RATES = (24, 25, 30, 48, 50, 60, 72, 90, 100, 120, 150, 200, 240, 250)


def pace(clip: Clip) -> float | None:
    """How fast a clip's strides are walked, against the pace at which their length is walked; None where too few are.

    Who walks at v on legs of length L makes strides of 2.3 L (v^2 / (g L))^0.3 (Alexander 1976), whatever the animal: the length
    of a stride, which no frame time changes, tells the speed it is walked at.
    """
    positions, _ = clip.world()
    _, headings = clip.root()
    ankles = positions[:, [FEET[0][2], FEET[1][2]], :2]
    apart = ((ankles[:, 0] - ankles[:, 1]) * heading_to_direction(headings)).sum(-1)
    steps = _crossings(apart)
    at = positions[steps, HIPS, :2]
    if len(steps) < 3:
        return None
    lengths, seconds = np.linalg.norm(at[2:] - at[:-2], axis=-1), (steps[2:] - steps[:-2]) / FPS
    walked = (lengths > _STRIDES[0] * _LEG) & (lengths < _STRIDES[1] * _LEG)
    if walked.sum() < _LEAST_STRIDES:
        return None
    asked = np.sqrt((lengths[walked] / (2.3 * _LEG)) ** (1 / 0.3) * _GRAVITY * _LEG)
    return float(np.median(lengths[walked] / seconds[walked] / asked))


def _crossings(apart: Array) -> Array:
    """Frames at which one foot passes the other, from well behind to well ahead."""
    side = np.where(apart > _APART, 1, np.where(apart < -_APART, -1, 0))
    clear = np.flatnonzero(side)
    change = np.flatnonzero(np.diff(side[clear]))
    return np.array([(clear[k] + clear[k + 1]) // 2 for k in change], dtype=int)


def remark_on_rate(clip: Clip, rate: float) -> tuple[str, ...]:
    """A sentence where a clip that was written at ``rate`` frames a second walks at a pace that no body has; else none."""
    found = pace(clip)
    if found is None or _PLAUSIBLE[0] <= found <= _PLAUSIBLE[1]:
        return ()
    likely = min(_RATES, key=lambda r: abs(np.log(r * found / rate)))
    slow = "slowly" if found < 1 else "fast"
    return (
        f"{clip.name}.bvh walks {max(found, 1 / found):.1f} times too {slow} for the length of its strides: its Frame Time says {rate:.4g} "
        f"frames a second; if that is wrong, write the true rate into mapping.toml beside it, such as `rate = {likely}`.",
    )
