"""A line over the floor that is kept to: slower where it bends, corrected where one drifts off it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from nsm_core.conventions import DT
from nsm_core.rotations import Array
from nsm_core.signals import gaussian_smooth

from .along import told
from .floor_plan import resample_path
from .path import Course

_STEP = 0.05  # metres between points
# Metres of the line over which a bend is looked at: less than half a stride.
_BEND = 0.25
_SLOWEST = 0.45  # m/s at which the tightest corners are gone: slower, steps come apart
# How soon (1/s) and how far (metres) what leads is moved aside against a drift off the line.
_DRIFT_RATE, _MOST_ASIDE = 0.4, 0.2
_TIGHT = 0.5  # of the speed asked for: bends that are gone slower are told
_NEAR = 0.25  # metres off the line up to which one is on it; a drift is learned of there alone


@dataclass(frozen=True)
class Corner:
    """A bend that is gone much slower than the rest: its place (2,), metres, and the speed there, m/s."""

    place: Array
    speed: float

    def __str__(self) -> str:
        there = f"at {told(self.place)}, where the line bends too tightly for its pace"
        return f"slowed down to {self.speed:.1f} m/s {there}"


@dataclass
class Track(Course):
    """A course that is kept to; as ``Course``, and ``sideways`` m/s2 by which a body is turned in bends.

    ``joins`` metres lead to the line itself.
    """

    sideways: float = 0.9
    joins: float = 0.0
    _limit: Array = field(init=False, repr=False)
    _along: Array = field(init=False, repr=False)
    _aside: float = field(default=0.0, init=False, repr=False)

    def __post_init__(self) -> None:
        self.points = resample_path(np.asarray(self.points, dtype=np.float64), _STEP)
        super().__post_init__()
        self._along = _directions(self.points)
        self._limit = self._speeds()

    def _speeds(self) -> Array:
        """Speeds (N,) up to which each point is passed, m/s, and from which the next bends can be reached."""
        limit = _passed_at(self._along, self.speed, self.sideways)
        if len(limit) > 2:
            limit = np.minimum(limit, gaussian_smooth(limit[:, None], 2.0)[:, 0])
        step = 2 * self.deceleration * _STEP
        for i in range(len(limit) - 2, -1, -1):
            limit[i] = min(limit[i], np.sqrt(limit[i + 1] ** 2 + step))
        return limit

    def advance(self, position: Array) -> None:
        """As ``Course.advance``, and learn how far one drifts off the line."""
        before = self.progress
        super().advance(position)
        off = np.asarray(position, dtype=np.float64) - self.at(np.array(self.progress))
        aside = float(off @ self._left(np.array(self.progress)))
        goes = self.joins < self.progress < self.length - 0.3 and self.progress > before
        if goes and abs(aside) < _NEAR:
            self._aside = float(np.clip(self._aside - _DRIFT_RATE * aside * DT, -_MOST_ASIDE, _MOST_ASIDE))

    def preview(self, speed: float, frames: Sequence[int]) -> tuple[Array, Array, Array]:
        """As ``Course.preview``, at the speeds of the bends ahead."""
        s, v = self.progress, max(speed, 0.0)
        way, pace = [s], [v]
        for _ in range(max(frames)):
            bend = self._limit[min(round(s / _STEP), len(self._limit) - 1)]
            stop = np.sqrt(2 * self.deceleration * max(self.length - s, 0)) + 0.02
            v = max(min(v + self.acceleration * DT, bend, stop), min(v - 2 * self.deceleration * DT, stop))
            s = min(s + v * DT, self.length)
            way.append(s)
            pace.append(v)
        at = np.array([way[f] for f in frames])
        # At its end the place counts, not the way there.
        ends = np.clip((self.length - at) / 0.5, 0, 1)[:, None]
        places = self.at(at) + self._aside * ends * self._left(at)
        return places, self.heading_at(at), np.array([pace[f] for f in frames])

    def _left(self, s: Array) -> Array:
        """Directions (..., 2) to the left of the line at ``s`` (...), metres."""
        ahead = np.stack([np.interp(s, self._length, self._along[:, k]) for k in (0, 1)], axis=-1)
        return np.stack((-ahead[..., 1], ahead[..., 0]), axis=-1)


def tight_corners(line: Array, speed: float, sideways: float) -> list[Corner]:
    """Corners of a line (N, 2) that are gone at less than half of ``speed``, m/s; ``sideways`` as of a
    ``Track``.
    """
    points = resample_path(np.asarray(line, dtype=np.float64), _STEP)
    limit = _passed_at(_directions(points), speed, sideways)
    tight = np.flatnonzero(limit < _TIGHT * speed)
    parts = np.split(tight, np.flatnonzero(np.diff(tight) > _BEND / _STEP) + 1) if len(tight) else []
    return [Corner(points[part[len(part) // 2]], float(limit[part].min())) for part in parts]


def _directions(points: Array) -> Array:
    """Directions (N, 2) of a line at its points (N, 2)."""
    along = np.gradient(points, axis=0) if len(points) > 1 else np.zeros((1, 2))
    return along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)


def _passed_at(along: Array, speed: float, sideways: float) -> Array:
    """Speeds (N,) at which a body passes points of a line with directions ``along`` (N, 2)."""
    turns = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    reach = max(1, round(_BEND / 2 / _STEP))
    padded = np.pad(turns, reach, mode="edge")
    bend = np.abs(padded[2 * reach :] - padded[: -2 * reach]) / (2 * reach * _STEP)
    return np.clip(np.sqrt(sideways / np.maximum(bend, 1e-6)), _SLOWEST, speed)


def off_line(line: Array, track: Array) -> Array:
    """Metres (N,) from points of ``line`` (N, 2), centimetres apart, to the ground track (T, 2) of one who
    has followed it, from when it comes to its start.

    Where a line crosses itself or is gone several times, the pass that belongs to each point counts.
    """
    line, track = np.asarray(line, dtype=np.float64), np.asarray(track, dtype=np.float64)
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
    begun = np.linalg.norm(track - line[0], axis=1)
    track = track[int(np.argmax(begun < max(_NEAR, begun.min() + 1e-9))) :]
    gone = np.zeros(len(track))  # how far along the line each frame is: never back, never far ahead at once
    here = 0.0
    for t, place in enumerate(track):
        near = np.flatnonzero((along >= here - 1e-9) & (along <= here + 0.5))
        here = (
            float(along[near[np.argmin(np.linalg.norm(line[near] - place, axis=1))]]) if len(near) else here
        )
        gone[t] = here
    away = np.full(len(line), np.inf)
    first = np.searchsorted(gone, along - 0.5)
    last = np.searchsorted(gone, along + 0.5, side="right")
    for i, point in enumerate(line):
        away[i] = _to_polyline(point, track[max(first[i] - 1, 0) : max(last[i] + 1, first[i] + 2)])
    return away


def _to_polyline(point: Array, line: Array) -> float:
    """Metres from a point (2,) to a line (N, 2)."""
    if len(line) < 2:
        return float(np.linalg.norm(line[0] - point)) if len(line) else float("nan")
    step = np.diff(line, axis=0)
    share = ((point - line[:-1]) * step).sum(1) / np.maximum((step * step).sum(1), 1e-12)
    return float(np.linalg.norm(line[:-1] + np.clip(share, 0, 1)[:, None] * step - point, axis=1).min())


__all__ = ["Track", "off_line", "tight_corners"]
