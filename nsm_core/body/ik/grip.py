"""How hands lie on what they hold: palms flat on it, fingers along it, wrists bent no more than need be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_matrix,
    quat_from_rotvec,
    quat_mul,
    quat_to_rotvec,
)

# Radians by which a hand lies askew of its forearm within the plane of its palm, with ease.
_EASY = np.radians(22)
# Of a wrist, from its forearm: bent any way, and turned about it (most of that is the forearm's own).
MOST_BEND, MOST_TWIST = np.radians(65), np.radians(80)

# Metres from the wrist to what lies across the palm, along fingers and off the palm; from the last sphere of
# a hand to its tips.
ACROSS, PALM, FINGERTIP = 0.075, 0.03, 0.015
SWIVEL = np.radians(40)  # by which a hand turns about what lies across its palm, to meet its forearm


@dataclass(frozen=True)
class Grip:
    """Where a hand that holds something faces: unit ways (3,), world, of the ``palm`` and of the fingers
    ``ahead``, which may turn about the first to meet the forearm.

    ``bar`` (3,) is the middle of what lies across the palm, such as a handle, ``room`` metres before a board
    that fingers do not go through; None where wrists are where they are led.  About it the hand turns by
    up to ``swivel`` radians.  ``share`` 0..1 of all this.
    """

    palm: Array
    ahead: Array
    bar: Array | None = None
    room: float = 0.0
    share: float = 1.0
    swivel: float = SWIVEL


def laid(
    palm: Array, ahead: Array, forearm: Array, side: int, lowest: Array, most: Array | float = np.inf
) -> Array:
    """World rotations (N, 4) of hands, ``side`` 0 right or 1 left, whose palms face the ways ``palm`` (N, 3).

    Fingers point ``ahead`` (N, 3), or turn from there, within the palm's plane and by no more than ``most``
    radians, to where the ``forearm`` (N, 3), its way to the wrist, is met with ease: no further down than the
    sine ``lowest`` (N,).
    """
    across = np.cross(palm, ahead)
    askew = np.arctan2((forearm * across).sum(1), (forearm * ahead).sum(1))
    turn = np.clip(0.0, askew - _EASY, askew + _EASY)
    turn = np.clip(turn, -np.asarray(most), most)
    # A forearm that comes straight at the palm says nothing of where fingers point.
    turn *= np.clip(np.hypot((forearm * across).sum(1), (forearm * ahead).sum(1)) / 0.5, 0, 1)
    steepest = np.arcsin(np.clip(lowest, 0, 1))
    down = np.where(across[:, 2] > 0, -turn, turn)
    turn = np.where(down > steepest, np.where(across[:, 2] > 0, -steepest, steepest), turn)
    fingers = np.cos(turn)[:, None] * ahead + np.sin(turn)[:, None] * across
    x, z = (1.0 if side else -1.0) * fingers, -palm
    return np.asarray(quat_from_matrix(np.stack((x, np.cross(z, x), z), axis=-1)))


def within(hands: Array, forearms: Array) -> Array:
    """World rotations (N, 4) of hands, bent and twisted from their ``forearms`` (N, 4) no further than a
    person's.
    """
    local = quat_mul(quat_conjugate(forearms), hands)
    about = twist_of(local)
    bend = quat_to_rotvec(quat_mul(local, quat_from_rotvec(-about[:, None] * np.eye(3)[0])))
    far = np.linalg.norm(bend, axis=1, keepdims=True)
    bend = bend * np.minimum(1, MOST_BEND / np.maximum(far, 1e-6))
    kept = quat_from_rotvec(np.clip(about, -MOST_TWIST, MOST_TWIST)[:, None] * np.eye(3)[0])
    return quat_mul(forearms, quat_mul(quat_from_rotvec(bend), kept))


def twist_of(wrists: Array) -> Array:
    """Radians (N,) by which local rotations (N, 4) of wrists turn about their forearms."""
    return np.asarray(2 * np.arctan2(wrists[:, 1] * np.where(wrists[:, 0] < 0, -1, 1), np.abs(wrists[:, 0])))


__all__ = ["ACROSS", "FINGERTIP", "PALM", "Grip", "laid", "twist_of", "within"]
