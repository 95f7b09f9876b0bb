"""The state of a batch of characters that pick and place, and the key frames that they are led to."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from nsm_core.model.features.state import KEY_OFFSETS, KEY_STEP
from nsm_core.rotations import Array


@dataclass
class HandlingState:
    """B characters at one moment, all in the world (papers/002 section 5.1).

    ``joint_position`` (B, J, 3) m, ``joint_forward``, ``joint_up`` (B, J, 3) unit axes, ``joint_velocity``
    (B, J, 3) m/s.  ``root_past`` (B, 31, 3): x, y, heading of the last second, now last; ``joints_past`` (B,
    31, 3, 9) of hips, right and left wrist: place, axis ahead, axis up.  ``root_future`` (B, 6, 3) and
    ``joints_future`` (B, 6, 3, 9) at the keys ahead.  ``phase`` (B, 3, 8), see ``phase``.
    """

    joint_position: Array
    joint_forward: Array
    joint_up: Array
    joint_velocity: Array
    root_past: Array
    joints_past: Array
    root_future: Array
    joints_future: Array
    phase: Array

    def __len__(self) -> int:
        return len(self.joint_position)

    @property
    def root(self) -> Array:
        """Current root (B, 3): x, y, heading."""
        return self.root_past[:, -1]

    @property
    def joints(self) -> Array:
        """Current key joints (B, 3, 9)."""
        return self.joints_past[:, -1]

    def root_keys(self) -> Array:
        """Roots (B, 13, 3) at all keys."""
        return np.concatenate((self.root_past[:, ::KEY_STEP], self.root_future), axis=1)

    def joint_keys(self) -> Array:
        """Key joints (B, 13, 3, 9) at all keys."""
        return np.concatenate((self.joints_past[:, ::KEY_STEP], self.joints_future), axis=1)

    def assign(self, rows: Array, other: HandlingState) -> None:
        """Overwrite the characters at ``rows`` with those of ``other``."""
        for f in fields(self):
            getattr(self, f.name)[rows] = getattr(other, f.name)


@dataclass
class Goals:
    """What B characters are led to: ``root`` (B, 13, 3), ``joints`` (B, 13, 3, 9) and ``label`` (B, 13, 9) of
    the key frame next after each key, the ``present`` label (B, 9), and the ``phase`` (B, 3, 8) at the key
    frame next after now.
    """

    root: Array
    joints: Array
    label: Array
    present: Array
    phase: Array


@dataclass(frozen=True)
class KeySchedule:
    """Key frames of one character: ``times`` (K,), frames, rising; ``root`` (K, 3), ``joints`` (K, 3, 9) and
    ``label`` (K, 9) there, the label being that of what begins then; ``first`` (9,) the label before all.
    """

    times: Array
    root: Array
    joints: Array
    label: Array
    first: Array

    def next_after(self, frames: Array) -> Array:
        """Numbers (...) of the key frames next after ``frames`` (...); the last one for ever."""
        return np.minimum(np.searchsorted(self.times, frames, side="right"), len(self.times) - 1)

    def at(self, frame: float) -> tuple[Array, Array, Array, Array]:
        """Roots (13, 3), joints (13, 3, 9), labels (13, 9) of the goals at all keys, and the present label
        (9,).
        """
        goals = self.next_after(frame + KEY_OFFSETS)
        passed = int(np.searchsorted(self.times, frame, side="right"))
        present = self.label[passed - 1] if passed else self.first
        return self.root[goals], self.joints[goals], self.label[goals], present


__all__ = ["Goals", "HandlingState", "KeySchedule"]
