"""What the rules of annotation measure on a clip, and the spans of actions that they find."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.clip import Clip, smoothed_root
from nsm_core.conventions import FPS
from nsm_core.rotations import Array
from nsm_core.signals import gaussian_smooth, intervals


@dataclass(frozen=True)
class Span:
    """An action with an object: the label rises over ``start``..``full`` and falls over ``leave``..``end``
    (frames).
    """

    action: str
    start: int
    full: int
    leave: int
    end: int


@dataclass(frozen=True)
class MeasuredMotion:
    """What the rules look at: ``positions`` and ``rotations`` in the world, root, and ``speed`` (T,), metres
    a second.
    """

    positions: Array
    rotations: Array
    root: Array
    heading: Array
    speed: Array

    def __len__(self) -> int:
        return len(self.positions)


def motion_of(clip: Clip) -> MeasuredMotion:
    """Measure a clip once for all rules."""
    positions, rotations = clip.world()
    root, heading = smoothed_root(positions)
    speed = np.linalg.norm(rate(root), axis=1)
    return MeasuredMotion(positions, rotations, root, heading, gaussian_smooth(speed, 6.0))


def rate(values: Array) -> Array:
    return np.gradient(values, axis=0) * FPS if len(values) > 1 else np.zeros_like(values)


def hold_while(flags: Array, frame: int, step: int) -> int:
    """Last frame from ``frame`` on, in steps, up to which ``flags`` hold."""
    while 0 <= frame + step < len(flags) and flags[frame + step]:
        frame += step
    return frame


def first_of(flags: Array, otherwise: int) -> int:
    found = np.flatnonzero(flags)
    return int(found[0]) if len(found) else otherwise


def closed(flags: Array, gap: int) -> Array:
    """Flags with gaps of up to ``gap`` frames filled."""
    filled = flags.copy()
    for a, b in intervals(~flags):
        if b - a <= gap and a > 0 and b < len(flags):
            filled[a:b] = True
    return filled


def inside_clip(span: Span, count: int) -> Span:
    """A span cut at the clip's ends; what begins or ends there has no ramp."""
    start, end = max(span.start, 0), min(span.end, count - 1)
    return Span(span.action, start, max(span.full, start), min(span.leave, end), end)
