"""Whether a walk is played at the speed it was walked at: what gravity says of stride length and pace."""

from __future__ import annotations

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import FEET, HIPS, OFFSETS, root_of
from nsm_core.conventions import FPS
from nsm_core.rotations import Array, heading_to_direction

_LEG = float(-OFFSETS[list(FEET[0][1:3]), 2].sum())
_GRAVITY = 9.81
_APART = 0.12  # metres that the ankles pass each other by for a step to count
_STRIDES = (0.5, 3.0)  # legs' lengths of strides that are walked
_AHEAD = 0.85  # share of a stride that leads where the body faces, before and after
_LEAST_STRIDES = 3
_RISE = 0.1  # of a stride's length: more is climbed
# Of the pace that the strides ask for: captured walks have 0.5 to 1, runs in turns up to 2.5.
_USUAL, _PLAUSIBLE = 0.75, (0.43, 2.6)
_RATES = (24, 25, 30, 50, 60, 100, 120, 200, 240)


def pace(clip: Clip) -> float | None:
    """How fast a clip's strides are walked, against the pace at which their length is walked; None where too
    few are.

    Who walks at v on legs of length L makes strides of 2.3 L (v^2 / (g L))^0.3 (Alexander 1976), whatever the
    animal: the length of a stride, which no frame time changes, tells the speed it is walked at.
    """
    positions, _ = clip.world()
    _, headings = root_of(positions)
    ankles = positions[:, [FEET[0][2], FEET[1][2]], :2]
    apart = ((ankles[:, 0] - ankles[:, 1]) * heading_to_direction(headings)).sum(-1)
    steps = crossings(apart)
    if len(steps) < 3:
        return None
    at, facing = positions[steps, HIPS, :2], heading_to_direction(headings[steps])
    strides, seconds = at[2:] - at[:-2], (steps[2:] - steps[:-2]) / FPS
    lengths = np.linalg.norm(strides, axis=-1)
    ahead = np.minimum((strides * facing[2:]).sum(-1), (strides * facing[:-2]).sum(-1)) > _AHEAD * lengths
    level = np.abs(positions[steps[2:], HIPS, 2] - positions[steps[:-2], HIPS, 2]) < _RISE * lengths
    walked = ahead & level & (lengths > _STRIDES[0] * _LEG) & (lengths < _STRIDES[1] * _LEG)
    if walked.sum() < _LEAST_STRIDES:
        return None
    asked = np.sqrt((lengths[walked] / (2.3 * _LEG)) ** (1 / 0.3) * _GRAVITY * _LEG)
    return float(np.median(lengths[walked] / seconds[walked] / asked))


def crossings(apart: Array) -> Array:
    """Frames at which one foot, ``apart`` (T,) metres ahead of the other, passes it, from well behind to well
    ahead.
    """
    side = np.where(apart > _APART, 1, np.where(apart < -_APART, -1, 0))
    clear = np.flatnonzero(side)
    change = np.flatnonzero(np.diff(side[clear]))
    return np.array([(clear[k] + clear[k + 1]) // 2 for k in change], dtype=int)


def remark_on_rate(clip: Clip, rate: float) -> tuple[str, ...]:
    """A sentence where a clip that was written at ``rate`` frames a second walks at a pace that no body has;
    else none.
    """
    found = pace(clip)
    if found is None or _PLAUSIBLE[0] <= found <= _PLAUSIBLE[1]:
        return ()
    true = rate * _USUAL / found
    likely = sorted(sorted(_RATES, key=lambda r: abs(np.log(r / true)))[:2])
    slow = "slowly" if found < 1 else "fast"
    return (
        f"{clip.name}.bvh walks too {slow} for the length of its strides: its Frame Time says {rate:.4g} "
        "frames a second, they look like "
        f"some {true:.0f}; if that is so, write the true rate into mapping.toml beside it, such as `rate = "
        f"{likely[0]}` or {likely[1]}.",
    )
