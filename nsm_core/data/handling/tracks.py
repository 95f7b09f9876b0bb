"""Performances as the controller learns them: states, goals and phases of any frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.clip import smoothed_root
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.model.features.state import KEY_OFFSETS, PIVOT, WINDOW
from nsm_core.model.handling.layout import KEY_JOINTS
from nsm_core.model.handling.phase import bounded
from nsm_core.model.handling.state import Goals, HandlingState, KeySchedule
from nsm_core.model.handling.tasks import labels_of
from nsm_core.rotations import Array, quat_to_matrix
from nsm_core.signals import gaussian_smooth

from .performances import Performance

_AHEAD, _PAST = KEY_OFFSETS[PIVOT + 1 :], np.arange(-WINDOW, 1)


@dataclass
class HandlingTracks:
    """N frames of performances one after the other, as in ``HandlingState`` and ``Goals``; ``first`` and
    ``last`` (N,) of the performance that a frame belongs to, ``key`` (N,) the key frame next after it.
    """

    position: Array
    forward: Array
    up: Array
    velocity: Array
    root: Array
    joints: Array
    label: Array
    feet: Array
    phase: Array
    first: Array
    last: Array
    key: Array

    def state(self, frames: Array) -> HandlingState:
        """States of frames (B,); what lies beyond a performance's ends stays as it is there."""
        ahead, past = self._within(frames, _AHEAD), self._within(frames, _PAST)
        return HandlingState(
            self.position[frames],
            self.forward[frames],
            self.up[frames],
            self.velocity[frames],
            self.root[past],
            self.joints[past],
            self.root[ahead],
            self.joints[ahead],
            self.phase[frames],
        )

    def goals(self, frames: Array) -> Goals:
        """Goals of frames (B,): the key frame next after each key."""
        to = self.key[self._within(frames, KEY_OFFSETS)]
        return Goals(
            self.root[to], self.joints[to], self.label[to], self.label[frames], self.phase[self.key[frames]]
        )

    def schedule(self, frame: int) -> KeySchedule:
        """Key frames of a performance from ``frame`` on, at which the schedule's time is 0."""
        keys = np.unique(self.key[frame : self.last[frame] + 1])
        return KeySchedule(
            keys - frame, self.root[keys], self.joints[keys], self.label[keys], self.label[frame]
        )

    def _within(self, frames: Array, offsets: Array) -> Array:
        return np.clip(frames[:, None] + offsets, self.first[frames][:, None], self.last[frames][:, None])


def phase_states(told: Sequence[tuple[Array, Array, Array]]) -> list[Array]:
    """Phase states (T, 3, C) of phase, frequency and amplitude (T, C) of each performance, as
    ``periodic_phase.phases`` tells them; amplitudes are shares of each channel's largest ones.
    """
    largest = np.percentile(np.concatenate([a for *_, a in told]), 99, axis=0)
    return [
        bounded(np.stack((turn, amplitude / np.maximum(largest, 1e-6), frequency), axis=1)).astype(np.float32)
        for turn, frequency, amplitude in told
    ]


def tracks_of(performances: Sequence[Performance], phases: Sequence[Array]) -> HandlingTracks:
    """Tracks of performances and their phase states (T, 3, C)."""
    parts: dict[str, list[Array]] = {name: [] for name in HandlingTracks.__dataclass_fields__}
    at = 0
    for p, phase in zip(performances, phases, strict=True):
        positions, turns = forward_kinematics(p.hips, p.rotations)
        axes = quat_to_matrix(turns)
        forward, up = -axes[..., 1], axes[..., 2]
        root, heading = smoothed_root(positions)
        count, named = len(positions), list(KEY_JOINTS)
        frames = np.flatnonzero(p.keys)
        # The label of a frame is that which began at the key frame before it.
        begun = np.concatenate(((0,), frames))[np.searchsorted(frames, np.arange(count), side="right")]
        following = frames[
            np.minimum(np.searchsorted(frames, np.arange(count), side="right"), len(frames) - 1)
        ]
        found = {
            "position": positions,
            "forward": forward,
            "up": up,
            "velocity": gaussian_smooth(np.gradient(positions, axis=0) * FPS, 0.5),
            "root": np.concatenate((root, heading[:, None]), axis=1),
            "joints": np.concatenate((positions[:, named], forward[:, named], up[:, named]), axis=-1),
            "label": labels_of(p.walk, p.tasks)[begun],
            "feet": p.feet,
            "phase": phase,
        }
        for name, values in found.items():
            parts[name].append(np.asarray(values, dtype=np.float32))
        parts["first"].append(np.full(count, at))
        parts["last"].append(np.full(count, at + count - 1))
        parts["key"].append(at + following)
        at += count
    return HandlingTracks(**{name: np.concatenate(values) for name, values in parts.items()})


__all__ = ["HandlingTracks", "phase_states", "tracks_of"]
