"""The state of a batch of characters: pose, past and future trajectory, goals and phase, all in the world.

One state class serves the training data (cut out of a take) and the stepper (advanced by the network), so
that both feed the network through the same functions of ``codec``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from nsm_core.body.skeleton import J
from nsm_core.conventions import FPS, GOAL_ACTIONS, STYLES
from nsm_core.distances import IDLE_PERIOD
from nsm_core.rotations import Array

KEYS = 13  # samples of the time series: one second back, now, one second ahead
PIVOT = 6
KEY_STEP = FPS // 6  # frames between keys
WINDOW = PIVOT * KEY_STEP  # 30 frames
FUTURE = KEYS - PIVOT - 1
KEY_OFFSETS = np.arange(-PIVOT, FUTURE + 1) * KEY_STEP  # frames of the keys relative to now
KEY_TIMES = KEY_OFFSETS / FPS  # seconds


@dataclass
class State:
    """B characters at one moment (papers/000 section 3.1; sizes in ``KEYS``).

    ``joint_position`` (B, J, 3) m, ``joint_forward`` and ``joint_up`` (B, J, 3) unit axes, ``joint_velocity``
    (B, J, 3) m/s, all world.  ``root_past`` (B, 31, 3): x, y, heading of the last second, oldest first, now
    last; ``style_past`` (B, 31, 7) and ``phase_past`` (B, 31) in cycles likewise.  ``root_future`` (B, 6, 3),
    ``style_future`` (B, 6, 7), ``phase_future`` (B, 6) at the keys ahead.  ``goal_position`` (B, 13, 3),
    ``goal_heading`` (B, 13) and ``goal_action`` (B, 13, 6) at all keys.
    """

    joint_position: Array
    joint_forward: Array
    joint_up: Array
    joint_velocity: Array
    root_past: Array
    style_past: Array
    phase_past: Array
    root_future: Array
    style_future: Array
    phase_future: Array
    goal_position: Array
    goal_heading: Array
    goal_action: Array

    def __len__(self) -> int:
        return len(self.joint_position)

    @property
    def root(self) -> Array:
        """Current root (B, 3): x, y, heading."""
        return self.root_past[:, -1]

    def root_keys(self) -> Array:
        """Roots (B, 13, 3) at all keys."""
        return np.concatenate((self.root_past[:, ::KEY_STEP], self.root_future), axis=1)

    def style_keys(self) -> Array:
        """Action labels (B, 13, 7) at all keys."""
        return np.concatenate((self.style_past[:, ::KEY_STEP], self.style_future), axis=1)

    def phase_keys(self) -> Array:
        """Phases (B, 13) in cycles at all keys."""
        return np.concatenate((self.phase_past[:, ::KEY_STEP], self.phase_future), axis=1)

    def assign(self, rows: Array, other: State) -> None:
        """Overwrite the characters at ``rows`` with those of ``other``."""
        for f in fields(self):
            getattr(self, f.name)[rows] = getattr(other, f.name)


def standing_state(positions: Array, forward: Array, up: Array, root: Array) -> State:
    """State of characters at rest since forever: joints (B, J, 3), axes (B, J, 3), roots (B, 3).

    Every sample is the current root, the label and the goal are idle, the idle phase has its period.
    """
    n = len(positions)
    idle, idle_goal = (
        np.zeros((n, 1, len(STYLES)), np.float32),
        np.zeros((n, KEYS, len(GOAL_ACTIONS)), np.float32),
    )
    idle[..., STYLES.index("idle")] = 1
    idle_goal[..., GOAL_ACTIONS.index("idle")] = 1

    def phase(offsets: Array) -> Array:
        return np.repeat((offsets[None] / (IDLE_PERIOD * FPS) % 1.0).astype(np.float32), n, axis=0)

    root = root.astype(np.float32)
    goal = np.concatenate((root[:, :2], np.zeros((n, 1), np.float32)), axis=1)
    return State(
        positions.astype(np.float32),
        forward.astype(np.float32),
        up.astype(np.float32),
        np.zeros((n, J, 3), np.float32),
        np.repeat(root[:, None], WINDOW + 1, axis=1),
        np.repeat(idle, WINDOW + 1, axis=1),
        phase(np.arange(-WINDOW, 1)),
        np.repeat(root[:, None], FUTURE, axis=1),
        np.repeat(idle, FUTURE, axis=1),
        phase(KEY_OFFSETS[PIVOT + 1 :]),
        np.repeat(goal[:, None], KEYS, axis=1),
        np.repeat(root[:, None, 2], KEYS, axis=1),
        idle_goal,
    )
