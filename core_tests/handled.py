"""A performance that needs no captures: a body that glides along and lifts its right hand to hold."""

from __future__ import annotations

import numpy as np

from nsm_core.body.clip import transform
from nsm_core.body.skeleton import INDEX, J
from nsm_core.data.handling.performances import Performance
from nsm_core.data.handling.tracks import HandlingTracks, tracks_of
from nsm_core.model.handling.phase import bounded
from nsm_core.model.handling.tasks import APPROACHES, HOLDS, LEAVES
from nsm_core.rotations import quat_from_rotvec

COUNT = 150


def handled(turn: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)) -> Performance:
    t = np.arange(COUNT) / 30
    hips = np.stack((0.02 * np.sin(3 * t), -0.4 * np.minimum(t, 2.5), 0.9 + 0.02 * np.cos(5 * t)), axis=-1)
    turns = np.zeros((COUNT, J, 3))
    turns[:, INDEX["RightShoulder"], 1] = -1.2 + 0.9 * np.sin(np.clip(t - 2, 0, 3))
    turns[:, INDEX["LeftShoulder"], 1] = 1.2
    turns[:, INDEX["RightElbow"], 2] = 0.3 + 0.2 * np.sin(2 * t)
    hips, rotations = transform(
        hips.astype(np.float32),
        quat_from_rotvec(turns).astype(np.float32),
        np.tile(np.array(shift, np.float32), (COUNT, 1)),
        np.full(COUNT, turn, np.float32),
    )
    tasks = np.zeros((COUNT, 2), np.int8)
    tasks[75:100, 0], tasks[100:115, 0], tasks[115:140, 0] = APPROACHES, HOLDS, LEAVES
    keys = np.zeros(COUNT, bool)
    keys[[60, 75, 100, 115, 140, COUNT - 1]] = True
    return Performance(hips, rotations, np.ones((COUNT, 2), bool), np.arange(COUNT) < 60, tasks, keys)


def walked(turn: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)) -> HandlingTracks:
    t = np.arange(COUNT)[:, None] / 30
    rates = np.linspace(0.4, 2.5, 8)[None]
    parts = (t * rates + 0.1 * np.sin(t), 0.5 + 0.2 * np.cos(t * rates), rates + 0 * t)
    phase = bounded(np.stack(parts, axis=1)).astype(np.float32)
    return tracks_of([handled(turn, shift)], [phase])
