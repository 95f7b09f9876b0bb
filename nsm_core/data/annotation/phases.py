"""Phase by rule (papers/000 section 5.1): keys where a cycle ends, and the phase between them.

A key is (frame, value) with a value over 0 up to 1; 1 is the end of a cycle and the begin of the next.
Between two keys the phase grows evenly, by less than one cycle, or by exactly one where both have the same
value.
"""

from __future__ import annotations

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.distances import IDLE_PERIOD
from nsm_core.rotations import Array
from nsm_core.signals import intervals

Key = tuple[int, float]
_SHORTEST = 10  # frames between two landings of one foot; less is a stumble of the label


def rule_keys(landing_foot: Array, moving: Array, transitions: list[tuple[int, int]]) -> list[Key]:
    """Keys of a clip: landings while it moves, ends of transitions, and 1 Hz elsewhere.

    ``landing_foot`` (T,) contacts of the foot whose landing ends a cycle (the left; the right for the
    mirrored clip); ``moving`` (T,) bool, where walk or run is on; ``transitions``: (first, last) frames of
    acyclic motion, one cycle each.
    """
    count = len(landing_foot)
    on = np.asarray(landing_foot) > 0.5
    acyclic = np.zeros(count, bool)
    fixed: set[int] = set()
    for a, b in transitions:
        a, b = max(a, 0), min(b, count - 1)
        if b - a >= _SHORTEST and not acyclic[a : b + 1].any():
            acyclic[a + 1 : b] = True
            fixed |= {a, b}
    for a, b in intervals(moving):
        steps = [
            int(f) + 1 for f in np.flatnonzero(~on[:-1] & on[1:]) if a <= f + 1 < b and not acyclic[f + 1]
        ]
        landings = [f for k, f in enumerate(steps) if k == 0 or f - steps[k - 1] >= _SHORTEST]
        fixed |= {f for f in landings if all(abs(f - k) >= _SHORTEST // 2 for k in fixed)}
        fixed |= _missed(landings)
    keys = sorted(k for k in fixed if 0 <= k < count)
    return _filled(keys, moving, count)


def _missed(landings: list[int]) -> set[int]:
    """Landings that the contacts do not show: even ones where a gap holds two cycles or more."""
    gaps = np.diff(landings)
    if len(gaps) < 2:
        return set()
    usual, found = float(np.median(gaps)), set()
    for start, gap in zip(landings, gaps, strict=False):
        parts = round(gap / usual)
        if 2 <= parts <= 4:
            found |= {round(start + gap * k / parts) for k in range(1, parts)}
    return found


def _filled(keys: list[int], moving: Array, count: int) -> list[Key]:
    """Keys with cycles of about a second where there are none, up to both ends of the clip."""
    period = IDLE_PERIOD * FPS
    if not keys:
        keys = [0]
    filled = [keys[0]]
    for b in keys[1:]:
        a = filled[-1]
        still = 1 - float(np.mean(moving[a:b]))
        parts = max(1, round((b - a) / period)) if still > 0.5 else max(1, round((b - a) / (1.6 * period)))
        filled += [round(a + (b - a) * k / parts) for k in range(1, parts + 1)]
    # Beyond the first and the last key the neighbouring period goes on, unless the body rests there.
    first = filled[1] - filled[0] if len(filled) > 1 and moving[: filled[0] + 1].mean() > 0.5 else period
    last = filled[-1] - filled[-2] if len(filled) > 1 and moving[filled[-1] :].mean() > 0.5 else period
    before, after = _outside(filled[0], first), _outside(count - 1 - filled[-1], last)
    head = (
        [(0, before[1])] + [(filled[0] - round(first * k), 1.0) for k in range(before[0], 0, -1)]
        if filled[0] > 0
        else []
    )
    tail = [(filled[-1] + round(last * k), 1.0) for k in range(1, after[0] + 1)]
    if filled[-1] < count - 1:
        tail = [k for k in tail if k[0] < count - 1] + [(count - 1, after[2] or 1.0)]
    return _unique([k for k in head if k[0] >= 0] + [(k, 1.0) for k in filled] + tail)


def _outside(frames: int, period: float) -> tuple[int, float, float]:
    """Whole cycles in ``frames``, the phase that far before the end of a cycle, and the phase that far after
    its begin.
    """
    cycles = frames / period
    whole = int(np.ceil(cycles - 1e-6)) - 1 if cycles > 0 else 0
    rest = round(float(cycles % 1.0), 3)
    return max(whole, 0), round(1.0 - rest, 3) or 1.0, rest


def _unique(keys: list[Key]) -> list[Key]:
    found: list[Key] = []
    for frame, value in keys:
        if not found or frame > found[-1][0]:
            found.append((frame, value))
    return found


def phase_of_keys(keys: list[Key], count: int) -> Array:
    """Unwrapped phase (count,) in cycles, float32, from keys; before the first and behind the last the period
    goes on.
    """
    if not keys:
        return (np.arange(count) / (IDLE_PERIOD * FPS)).astype(np.float32)
    frames, values = np.array([k for k, _ in keys]), np.array([v for _, v in keys])
    steps = np.diff(values) % 1.0
    steps[steps < 1e-6] = 1.0
    total = values[0] % 1.0 + np.concatenate(((0.0,), np.cumsum(steps)))
    rates = steps / np.diff(frames) if len(steps) else np.array((1 / (IDLE_PERIOD * FPS),))
    t = np.arange(count)
    phase = np.interp(t, frames, total)
    phase += np.minimum(t - frames[0], 0) * rates[0] + np.maximum(t - frames[-1], 0) * rates[-1]
    return (phase - np.floor(phase[0])).astype(np.float32)


def keys_of_phase(phase: Array, every: int = 3) -> list[Key]:
    """Keys of a measured phase (T,) in cycles that never runs backwards: the ends of cycles, and one at least
    ``every`` frames.
    """
    frames = np.unique(np.concatenate((np.arange(0, len(phase), every), (len(phase) - 1,))))
    keys: list[Key] = []
    for frame in frames:
        value = round(float(phase[frame] % 1.0), 3) or 1.0
        if keys and value == keys[-1][1]:  # the same value twice would be a whole cycle
            continue
        keys.append((int(frame), value))
    return keys
