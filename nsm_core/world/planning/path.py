"""A course over the floor: where a walker should be and face in the coming seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from nsm_core.conventions import DT
from nsm_core.rotations import Array, direction_to_heading, wrap_angle


@dataclass
class Course:
    """A path to be walked: points (N, 2), metres, and how to end.

    ``final_heading`` is reached over the last ``turn_distance`` metres; speeds in m/s, accelerations in m/s2;
    ``most`` (N,) are speeds that are kept to at the points, where that is given.
    Stitching lays training takes along courses and the locomotion mode leads characters along them (section
    4.1).
    """

    points: Array
    final_heading: float
    speed: float = 1.2
    turn_distance: float = 0.7
    acceleration: float = 1.3
    deceleration: float = 0.9
    progress: float = 0.0
    most: Array | None = None
    _length: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        self._length = np.concatenate(([0.0], np.cumsum(steps)))

    @property
    def length(self) -> float:
        """Metres from start to end."""
        return float(self._length[-1])

    def at(self, s: Array) -> Array:
        """Points (..., 2) at arc lengths ``s`` (...), metres, held at the ends."""
        return np.stack([np.interp(s, self._length, self.points[:, k]) for k in range(2)], axis=-1)

    def heading_at(self, s: Array) -> Array:
        """Desired headings (...), radians: along the path, turning to the final one near its end."""
        ahead = self.at(np.minimum(s + 0.15, self.length)) - self.at(np.maximum(s - 0.15, 0.0))
        along = direction_to_heading(ahead)
        w = np.clip(1 - (self.length - s) / max(self.turn_distance, 1e-3), 0, 1)
        w = w * w * (3 - 2 * w)
        return along + w * wrap_angle(self.final_heading - along)

    def advance(self, position: Array) -> None:
        """Move the progress to the place of the path nearest to ``position`` (2,), never backwards."""
        s = np.linspace(self.progress, min(self.progress + 0.5, self.length), 26)
        self.progress = float(s[np.argmin(np.linalg.norm(self.at(s) - position, axis=1))])

    def preview(self, speed: float, frames: Sequence[int]) -> tuple[Array, Array, Array]:
        """Desired positions (n, 2), headings (n,) and speeds (n,) at ``frames`` (n) from now, starting at
        ``speed`` (m/s).
        """
        s, v = self.progress, max(speed, 0.0)
        way, pace = [s], [v]
        for _ in range(max(frames)):
            v = min(
                v + self.acceleration * DT,
                self.speed if self.most is None else float(np.interp(s, self._length, self.most)),
                np.sqrt(2 * self.deceleration * max(self.length - s, 0)) + 0.02,
            )
            s = min(s + v * DT, self.length)
            way.append(s)
            pace.append(v)
        at = np.array([way[f] for f in frames])
        return self.at(at), self.heading_at(at), np.array([pace[f] for f in frames])
