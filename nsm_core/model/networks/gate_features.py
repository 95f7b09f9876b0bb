"""What the gates of other networks read out of the inputs; for numpy arrays and torch tensors alike.

``xp`` is the module, numpy or torch, whose functions the values are computed with.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nsm_core.body.skeleton import INDEX
from nsm_core.conventions import GOAL_ACTIONS, STYLES
from nsm_core.model.features.layout import FRAME, GOAL, INPUT
from nsm_core.model.features.state import KEYS, PIVOT
from nsm_core.rotations import Array

_S, _A = len(STYLES), len(GOAL_ACTIONS)
_FEET = [INDEX[f"{side}{joint}"] for side in ("Right", "Left") for joint in ("Ankle", "Toe")]
_VELOCITY = INPUT.slices["frame"].start + FRAME.slices["joint_velocity"].start
# Where the velocities of ankles and toes stand in the input: what a MANN gates by.
FOOT_VELOCITIES = np.array([_VELOCITY + 3 * joint + axis for joint in _FEET for axis in range(3)])
PER_KEY = 2 + _S + 3 * _A  # features of a key where the phase stands beside the labels
# Features of a key that are labels, and those of each goal action: itself, its distance, its angle.
_GOALS = np.arange(_S, _S + 3 * _A)
_AWAY = _GOALS.reshape(_A, 3)[:, 1:].ravel()
BLINDABLE = ("environment", "interaction")  # parts of the input that a sensor fills
# Of the gating features: what can be left out, by name.
GATE_PARTS = {"gate_goals": _GOALS, "gate_distances": _AWAY}


def modulated_columns(part: str) -> Array:
    """Columns of the gating features (650) that a part of ``GATE_PARTS`` fills."""
    each = (2 * GATE_PARTS[part][:, None] + np.arange(2)).ravel()
    return _of_all_keys(each, 2 * (_S + 3 * _A))


def plain_columns(part: str) -> Array:
    """Columns of ``concatenated`` that a part of ``GATE_PARTS`` fills."""
    return _of_all_keys(2 + GATE_PARTS[part], PER_KEY)


def _of_all_keys(each: Array, width: int) -> Array:
    return (np.arange(KEYS)[:, None] * width + each).ravel()


def _get(x: Any, part: str, layout: Any, name: str) -> Any:
    at = INPUT.slices[part].start
    block = x[:, at + layout.slices[name].start : at + layout.slices[name].stop]
    return block.reshape((len(x), *layout.shapes[name]))


def waves(x: Any, gating: Any) -> Any:
    """Sine and cosine (B, 13, 2) of the phase at each key, of inputs (B, 4018) and gating features (B, 650)
    in physical units.

    The labels stand in both, so that the phase they were multiplied by can be told.
    """
    label = 2 * _get(x, "frame", FRAME, "trajectory_style") - 1
    times = gating.reshape((len(x), KEYS, _S + 3 * _A, 2))[:, :, :_S]
    return (label[..., None] * times).sum(2) / (label * label).sum(2)[..., None]


def phases(xp: Any, x: Any, gating: Any) -> Any:
    """Present phase (B,), radians, of inputs and gating features in physical units."""
    wave = waves(x, gating)[:, PIVOT]
    return xp.arctan2(wave[:, 0], wave[:, 1])


def concatenated(xp: Any, x: Any, gating: Any) -> Any:
    """Gating features (B, 351) in which phase, labels, goal distances and angles stand side by side instead
    of being multiplied, of inputs and gating features in physical units.
    """
    away = _get(x, "frame", FRAME, "trajectory_position") - _get(x, "goal", GOAL, "goal_position")[..., :2]
    one, other = (
        _get(x, "frame", FRAME, "trajectory_direction"),
        _get(x, "goal", GOAL, "goal_direction"),
    )
    cross = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    angle = xp.arctan2(abs(cross), (one * other).sum(-1))
    distance = ((away * away).sum(-1)) ** 0.5
    goals = 2 * _get(x, "goal", GOAL, "goal_action") - 1
    scaled = xp.stack((goals, goals * distance[..., None], goals * angle[..., None]), -1)
    label = 2 * _get(x, "frame", FRAME, "trajectory_style") - 1
    parts = (waves(x, gating), label, scaled.reshape((len(x), KEYS, 3 * _A)))
    return xp.concatenate(parts, -1).reshape((len(x), KEYS * PER_KEY))


def catmull_rom(xp: Any, phase: Any, points: Any) -> Any:
    """Coefficients (B, K) of ``phase`` (B,), radians: a cubic Catmull-Rom spline through K control points,
    ``points`` the numbers 0 .. K - 1, evenly over the cycle (Holden et al., 2017).
    """
    count = len(points)
    at = count * phase[:, None] / (2 * np.pi)
    u = abs((at - points + count / 2) % count - count / 2)  # control points away, round the cycle
    near = 1 - 2.5 * u**2 + 1.5 * u**3
    far = 2 - 4 * u + 2.5 * u**2 - 0.5 * u**3
    return xp.where(u < 1, near, xp.where(u < 2, far, 0 * u))
