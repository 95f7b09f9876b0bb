"""Poses of a wrist that holds something, of either hand.

Wrist frame: -Y from the wrist along the hand to what it holds, Z to the thumb's side; the hand closes along
X.  What is held lies ``TO_HELD`` metres before the wrist.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array, cross, matrix_from_forward_up

TO_HELD = 0.11  # from the wrist to the middle of what the hand is closed about, metres
PALM_SKIN = 0.022  # from the middle of a wrist to the skin of the palm, metres
WIDEST_GRIP = 0.1  # what thumb and fingers reach around, metres


@dataclass(frozen=True)
class WristPose:
    """``place`` (3,) metres of the wrist, ``rotation`` (3, 3) of its frame."""

    place: Array
    rotation: Array

    @property
    def towards(self) -> Array:
        """Unit way (3,) from the wrist to what it holds."""
        return -self.rotation[:, 1]

    @property
    def held(self) -> Array:
        """The middle (3,) of what the hand is closed about."""
        return self.place + TO_HELD * self.towards


def wrist_at(held: Array, towards: Array, thumb: Array) -> WristPose:
    """The pose that holds a point (3,) with the hand pointing ``towards`` (3,) and its thumb's side near
    ``thumb`` (3,).
    """
    towards = np.asarray(towards, dtype=np.float64)
    towards = towards / np.linalg.norm(towards)
    thumb = np.asarray(thumb, dtype=np.float64)
    if np.linalg.norm(cross(towards, thumb)) < 1e-6:
        thumb = np.roll(towards, 1)
    return WristPose(
        np.asarray(held, dtype=np.float64) - TO_HELD * towards, matrix_from_forward_up(towards, thumb)
    )


def palm_of(rotation: Array, side: float) -> Array:
    """The way (3,) that the palm faces of a hand turned so; ``side`` -1 right, 1 left."""
    return np.asarray(side * -rotation[:, 0])


def beside_held(wrist: WristPose, width: float, side: float) -> WristPose:
    """The pose of a wrist whose palm lies on what is ``width`` metres wide, where ``wrist`` points through
    its middle; ``side`` -1 right, 1 left.
    """
    return WristPose(wrist.place - (width / 2 + PALM_SKIN) * palm_of(wrist.rotation, side), wrist.rotation)
