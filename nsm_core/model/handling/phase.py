"""Phases as a linear system, and the Kalman filter that finds the goal's (papers/002 section 5.2).

A phase state is (B, 3, C): phase S in cycles, amplitude A and frequency F in Hz of every channel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.conventions import DT, FPS
from nsm_core.rotations import Array

S, A, F = range(3)
BETA = 0.5  # how much of the update of S is the network's; the rest follows the frequency
FASTEST = FPS / 2  # Hz, the Nyquist frequency
PROCESS = 0.2  # of the data's variance: noise of a step (below equation 19)
# Equation 16's A, which is equation 19's F.
STEP = np.array(((1.0, 0.0, DT), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


def controlled(phase: Array, control: Array) -> Array:
    """Phase state (B, 3, C) one frame later under a control U (B, 3, C): equations 15 and 16."""
    following = np.einsum("ij,bjc->bic", STEP, phase) + np.array((BETA, 1.0, 1.0))[:, None] * control
    return bounded(following)


def control_of(phase: Array, following: Array) -> Array:
    """The control U (B, 3, C) that leads from a phase state to the next: equation 17, as it is learnt."""
    change = following - np.einsum("ij,bjc->bic", STEP, phase)
    change[:, S] = _shortest(change[:, S]) / BETA
    return change


def bounded(phase: Array) -> Array:
    """A phase state within its bounds: S in 0..1, A in 0..1 and F up to the Nyquist frequency."""
    phase = phase.copy()
    phase[:, S] %= 1.0
    phase[:, A] = np.clip(phase[:, A], 0.0, 1.0)
    phase[:, F] = np.clip(phase[:, F], 0.0, FASTEST)
    return phase


def wave_of(phase: Array) -> Array:
    """Real and imaginary parts (B, C, 2) of a phase state: equation 13 without its noise."""
    angle = 2 * np.pi * phase[:, S]
    return phase[:, A, :, None] * np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def phase_of(wave: Array, frequency: Array) -> Array:
    """Phase state (B, 3, C) of real and imaginary parts (B, C, 2) and frequencies (B, C)."""
    turns = np.arctan2(wave[..., 1], wave[..., 0]) / (2 * np.pi)
    return bounded(np.stack((turns, np.linalg.norm(wave, axis=-1), frequency), axis=1))


@dataclass
class GoalFilter:
    """Goal phase of B characters, ``state`` (B, 3, C), and its covariance ``spread`` (B, C, 3, 3).

    ``variance`` (3, C) of S, A and F over the data.
    """

    variance: Array
    state: Array
    spread: Array

    @classmethod
    def unknown(cls, variance: Array, batch: int) -> GoalFilter:
        """Nothing known, as algorithm 1 begins: both zero."""
        channels = variance.shape[1]
        return cls(variance, np.zeros((batch, 3, channels)), np.zeros((batch, channels, 3, 3)))

    @property
    def noise(self) -> Array:
        """Q (C, 3, 3) of equation 19, in the order of the state."""
        return PROCESS * self.variance.T[:, :, None] * np.eye(3)

    def renew(self, rows: Array) -> None:
        """Characters ``rows`` (B,) have another goal: of its phase is known what the data's spread tells."""
        self.spread[rows] = self.variance.T[:, :, None] * np.eye(3)

    def predict(self) -> None:
        """Equation 18."""
        self.state = bounded(np.einsum("ij,bjc->bic", STEP, self.state))
        self.spread = STEP @ self.spread @ STEP.T + self.noise

    def measure(self, measured: Array, doubt: Array, rows: Array | None = None) -> None:
        """Equation 20 with one measurement (B, 3, C), whose covariance is ``doubt`` (B,) times Q: 1 of what
        is matched, equation 22's deviation of what the network predicts.  Only characters ``rows`` (B,) bool.
        """
        rows = np.ones(len(measured), bool) if rows is None else rows
        cover = doubt[:, None, None, None] * self.noise
        gain = self.spread @ np.linalg.inv(self.spread + cover + 1e-9 * np.eye(3))
        off = measured - self.state
        off[:, S] = _shortest(off[:, S])
        moved = bounded(self.state + np.einsum("bcij,bjc->bic", gain, off))
        self.state = np.where(rows[:, None, None], moved, self.state)
        spread = (np.eye(3) - gain) @ self.spread
        self.spread = np.where(rows[:, None, None, None], spread, self.spread)


def _shortest(turns: Array) -> Array:
    """Cycles (...) as the shortest way round."""
    return turns - np.round(turns)


__all__ = ["GoalFilter", "bounded", "control_of", "controlled", "phase_of", "wave_of"]
