"""The controller at run time: it leads characters to key frames, with the goal's phase found by a Kalman
filter (papers/002 algorithm 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core.model.features.codec import turn_in
from nsm_core.model.features.state import PIVOT
from nsm_core.model.handling.codec import advance, build_inputs
from nsm_core.model.handling.layout import layout_description
from nsm_core.model.handling.phase import GoalFilter
from nsm_core.model.handling.state import Goals, HandlingState, KeySchedule
from nsm_core.model.handling.tasks import HOLDS, TASKS
from nsm_core.model.networks.handling_config import HandlingConfig
from nsm_core.model.networks.handling_numpy import NumpyHandling
from nsm_core.model.networks.protocol import Weights
from nsm_core.rotations import Array

from .network_of import load_network

# Where the goal's phase comes from (table 4): nowhere, the nearest key frame of the data, the network's own
# estimate, or the filter over both.
NONE, MATCHED, PREDICTED, KALMAN = "none", "matched", "predicted", "kalman"
NEAR_ROOT, NEAR_HAND = 0.25, 0.03  # metres by which a key frame is reached
PATIENCE = 30  # frames that its time waits for one that is not


@dataclass
class Rolled:
    """What N frames of B characters came to: ``position``, ``forward``, ``up`` (N, B, J, 3), ``root`` (N, B,
    3), ``contact`` (N, B, 2) of the feet, and ``clock`` (N, B), frames of each one's schedule.
    """

    position: Array
    forward: Array
    up: Array
    root: Array
    contact: Array
    clock: Array


class HandlingModel:
    """A trained controller; ``metadata`` is that of the weights file."""

    def __init__(self, config: HandlingConfig, weights: Weights) -> None:
        self.config, self.metadata = config, weights.metadata
        self._net, self._statistics = NumpyHandling(config, weights), weights.statistics

    def roll(
        self, state: HandlingState, schedules: list[KeySchedule], frames: int, goal_phase: str
    ) -> Rolled:
        """Lead B characters from ``state`` along their schedules for so many frames; ``goal_phase`` as the
        module's constants say.  A schedule's time begins at 0 and waits, PATIENCE frames at most, where a key
        frame comes that is not reached.
        """
        batch = len(state)
        clock, waited = np.zeros(batch), np.zeros(batch, int)
        keys = np.array([s.next_after(np.array(0.0)) for s in schedules])
        kalman = GoalFilter.unknown(self._statistics["phase_variance"].astype(np.float64), batch)
        matched = self._matched(schedules, keys)
        # Before anything is predicted the nearest key frame is all that is known.
        phase = matched.copy()
        kalman.state = matched.copy()
        kalman.renew(np.arange(batch))
        found = []
        for _ in range(frames):
            parts = [s.at(t) for s, t in zip(schedules, clock, strict=True)]
            root, joints, label, present = (np.stack(p) for p in zip(*parts, strict=True))
            goals = Goals(root, joints, label, present, phase)
            told = advance(self._net.outputs(build_inputs(state, goals)), state, goals)
            state = told.state
            near, reaching = _reached(state, goals)
            if goal_phase == KALMAN:
                kalman.predict()
                kalman.measure(told.goal_phase, told.deviation)
                kalman.measure(matched, np.ones(batch), near & ~reaching)
                phase = kalman.state
            elif goal_phase == PREDICTED:
                phase = told.goal_phase
            now = np.array([s.next_after(t) for s, t in zip(schedules, clock + 1, strict=True)])
            waits = (now > keys) & ~(near & reaching) & (waited < PATIENCE)
            waited = np.where(waits, waited + 1, 0)
            clock = np.where(waits, clock, clock + 1)
            changed = np.flatnonzero((now > keys) & ~waits)
            if len(changed):
                keys[changed] = now[changed]
                matched = self._matched(schedules, keys)
                kalman.renew(changed)
                if goal_phase == MATCHED:
                    phase = matched.copy()
            found.append(
                (state.joint_position, state.joint_forward, state.joint_up, state.root, told.contact, clock)
            )
        return Rolled(*(np.stack(values) for values in zip(*found, strict=True)))

    def _matched(self, schedules: list[KeySchedule], keys: Array) -> Array:
        """Phases (B, 3, C) of the data's key frames most like the ones of numbers ``keys`` (B,)."""
        features = np.stack([key_features(s)[k] for s, k in zip(schedules, keys, strict=True)])
        off = self._statistics["key_features"][None] - features[:, None]
        nearest = np.argmin(np.square(off).sum(-1), axis=1)
        return self._statistics["key_phases"][nearest].astype(np.float64)


def key_features(schedule: KeySchedule) -> Array:
    """What key frames (K, MATCHED) are matched by: key joints seen from the root, labels before and then."""
    count = len(schedule.times)
    joints = schedule.joints.reshape(count, -1, 9).copy()
    joints[..., :2] -= schedule.root[:, None, :2]
    parts = [turn_in(joints[..., k : k + 3], schedule.root) for k in (0, 3, 6)]
    before = np.concatenate((schedule.first[None], schedule.label[:-1]))
    seen = np.concatenate(parts, axis=-1).reshape(count, -1)
    return np.concatenate((seen, before, schedule.label), axis=1).astype(np.float32)


def _reached(state: HandlingState, goals: Goals) -> tuple[Array, Array]:
    """Whether roots and hands (B,) are near the goal; a hand counts where its goal is to begin to hold."""
    root = np.linalg.norm(state.root[:, :2] - goals.root[:, PIVOT, :2], axis=-1) < NEAR_ROOT
    away = np.linalg.norm(state.joints[:, 1:, :3] - goals.joints[:, PIVOT, 1:, :3], axis=-1)
    holds = goals.label[:, PIVOT, 1:].reshape(len(root), 2, TASKS)[..., HOLDS] > 0.5
    return root, ((away < NEAR_HAND) | ~holds).all(1)


def load_handling(path: str | Path) -> HandlingModel:
    """Load a weights file; WeightsError where it cannot be used."""
    return HandlingModel(*load_network(path, layout_description(), HandlingConfig, "the controller's"))


__all__ = [
    "KALMAN",
    "MATCHED",
    "NONE",
    "PREDICTED",
    "HandlingModel",
    "Rolled",
    "key_features",
    "load_handling",
]
