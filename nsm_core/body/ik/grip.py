"""How hands lie on what they hold: palms flat on it, fingers along it, wrists bent no more than need be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array, quat_from_matrix

# Radians by which a hand lies askew of its forearm within the plane of its palm, with ease.
_EASY = np.radians(22)


@dataclass(frozen=True)
class Grip:
    """Where a hand that holds something faces: unit ways (3,), world, of the ``palm`` and of the fingers
    ``ahead``, which may turn about the first to meet the forearm.
    """

    palm: Array
    ahead: Array


def laid(palm: Array, ahead: Array, forearm: Array, side: int, lowest: Array) -> Array:
    """World rotations (N, 4) of hands, ``side`` 0 right or 1 left, whose palms face the ways ``palm`` (N, 3).

    Fingers point ``ahead`` (N, 3), or turn from there, within the palm's plane, to where the ``forearm``
    (N, 3), its way to the wrist, is met with ease: no further down than the sine ``lowest`` (N,) of it.
    """
    across = np.cross(palm, ahead)
    askew = np.arctan2((forearm * across).sum(1), (forearm * ahead).sum(1))
    turn = np.clip(0.0, askew - _EASY, askew + _EASY)
    # A forearm that comes straight at the palm says nothing of where fingers point.
    turn *= np.clip(np.hypot((forearm * across).sum(1), (forearm * ahead).sum(1)) / 0.5, 0, 1)
    steepest = np.arcsin(np.clip(lowest, 0, 1))
    down = np.where(across[:, 2] > 0, -turn, turn)
    turn = np.where(down > steepest, np.where(across[:, 2] > 0, -steepest, steepest), turn)
    fingers = np.cos(turn)[:, None] * ahead + np.sin(turn)[:, None] * across
    x, z = (1.0 if side else -1.0) * fingers, -palm
    return np.asarray(quat_from_matrix(np.stack((x, np.cross(z, x), z), axis=-1)))


__all__ = ["Grip", "laid"]
