"""Rules for hands: what is carried by both, and where one or both hold a door."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.body.skeleton import INDEX
from nsm_core.conventions import FPS
from nsm_core.rotations import Array, rotate_planar
from nsm_core.signals import gaussian_smooth, intervals

from .measures import MeasuredMotion, Span, closed, first_of, hold_while, inside_clip, rate

_REACH = round(0.5 * FPS)  # frames over which the labels of hands come and go at least
_WRISTS = [INDEX["RightWrist"], INDEX["LeftWrist"]]


def _hands(motion: MeasuredMotion) -> Array:
    """Wrists (T, 2, 3) in the root frame: x to the left, -y ahead, z up."""
    local = motion.positions[:, _WRISTS].copy()
    local[..., :2] -= motion.root[:, None]
    return rotate_planar(local, -motion.heading[:, None])


def _windowed(values: Array, half: int, function: Callable[..., Array]) -> Array:
    """``function`` over the 2 half + 1 frames around each, along the last axis of windows."""
    padded = np.pad(values, (half, half), mode="edge")
    return function(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=-1)


def carries(motion: MeasuredMotion) -> list[Span]:
    """Both hands in front at one height and a distance that does not change, elbows bent: they hold
    something.
    """
    hands = _hands(motion)
    apart = np.linalg.norm(hands[:, 0] - hands[:, 1], axis=-1)
    ahead = -hands[..., 1]
    rigid = _windowed(apart, 8, np.ptp) < 0.07
    level = (np.abs(hands[:, 0, 2] - hands[:, 1, 2]) < 0.16) & (np.abs(ahead[:, 0] - ahead[:, 1]) < 0.16)
    bent = np.min([_elbow(motion, side) for side in ("Right", "Left")], axis=0) > np.radians(35)
    pair = rigid & level & (ahead.min(1) > 0.05) & (apart > 0.12) & (apart < 0.7)
    held = pair & bent & (hands[..., 2].min(1) > 0.7)
    spans: list[Span] = []
    height = gaussian_smooth(hands[..., 2].mean(1), 2.0)
    for a, b in intervals(closed(held, 6)):
        if b - a < 0.5 * FPS:
            continue
        same = (np.abs(apart - np.median(apart[a:b])) < 0.1) & level & (ahead.min(1) > 0.03)
        first, last = hold_while(same, a, -1), hold_while(same, b - 1, 1)
        # A lift starts, and a box is let go, where the hands are lowest.
        grasp = (
            first + int(np.argmin(height[first : a + 1]))
            if height[first : a + 1].min() < height[a] - 0.1
            else a
        )
        release = (
            b - 1 + int(np.argmin(height[b - 1 : last + 1]))
            if height[b - 1 : last + 1].min() < height[b - 1] - 0.1
            else b - 1
        )
        # Hands that only rest before a standing body hold nothing that could be told.
        walks = float((motion.speed[a:b] > 0.6).sum()) > 0.5 * FPS
        if not walks and min(height[grasp], height[release]) > 0.72:
            continue
        grasp = 0 if grasp < _REACH / 2 else grasp
        release = len(motion) - 1 if release > len(motion) - 1 - _REACH / 2 else release
        if spans and grasp <= spans[-1].leave + FPS:  # a grip is not let go for a moment
            old = spans.pop()
            spans.append(Span("carry", old.start, old.full, release, _straightens(height, release, 1)))
            continue
        spans.append(
            Span("carry", _straightens(height, grasp, -1), grasp, release, _straightens(height, release, 1))
        )
    return [inside_clip(s, len(motion)) for s in spans]


def _straightens(height: Array, frame: int, step: int) -> int:
    """Frame, before or behind ``frame``, at which the hands begin to go down to an object or are up again;
    within 2 s.
    """
    if not _REACH / 2 < frame < len(height) - _REACH / 2:
        return frame  # held when the clip begins or ends
    way = height[frame::step][: 2 * FPS]
    return frame + step * max(first_of(way > way.max() - 0.1, 0), _REACH)


def _elbow(motion: MeasuredMotion, side: str) -> Array:
    """Bend (T,) of an elbow, radians; 0 is straight."""
    s, e, w = (motion.positions[:, INDEX[side + n]] for n in ("Shoulder", "Elbow", "Wrist"))
    cosine = np.sum((e - s) * (w - e), axis=-1) / np.maximum(
        np.linalg.norm(e - s, axis=-1) * np.linalg.norm(w - e, axis=-1), 1e-9
    )
    return np.arccos(np.clip(cosine, -1, 1))


def reaches(motion: MeasuredMotion) -> list[tuple[Span, list[int]]]:
    """One hand far ahead at the height of a handle while the other is not, or both pushing with straight
    arms.
    """
    hands = _hands(motion)
    ahead, height = -hands[..., 1], hands[..., 2]
    speed = np.stack(
        [np.linalg.norm(rate(gaussian_smooth(motion.positions[:, w], 1.5)), axis=1) for w in _WRISTS], axis=1
    )
    level = (height > 0.75) & (height < 1.4)
    found: list[tuple[Span, list[int]]] = []

    def add(flags: Array, seconds: float, which: list[int]) -> None:
        for a, b in intervals(closed(flags, 4)):
            if b - a >= seconds * FPS:
                found.append(
                    (inside_clip(Span("open", a - _REACH, a, b - 1, b - 1 + _REACH), len(motion)), which)
                )

    for hand in (0, 1):
        alone = (ahead[:, hand] > 0.33) & level[:, hand] & (speed[:, hand] < 0.6) & (ahead[:, 1 - hand] < 0.2)
        add(alone & (motion.speed < 0.6), 0.3, [hand])
    straight = np.max([_elbow(motion, side) for side in ("Right", "Left")], axis=0) < np.radians(30)
    add(straight & level.all(1) & (ahead.min(1) > 0.55), 1.0, [0, 1])
    return found
