"""A hand that is led by its planned pose: what a frame asks of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.body.capsules import BUNDLED
from nsm_core.body.ik.grip import FINGERTIP, PALM, Grip
from nsm_core.rotations import Array
from nsm_core.signals import smooth_step
from nsm_core.world.affordances.reach import LEFT, RIGHT
from nsm_core.world.scene.wrist import TO_HELD, WristPose, palm_of

from .hold import Lead, SeenBody

# Metres before what lies across the palm that fingers reach: the bundled hand's.
_ROOM = BUNDLED.hand + FINGERTIP - TO_HELD
# A planned hand turns little about what it holds: the wrist would leave the way that has room for it.
_SWIVEL = np.radians(10)
_FOLDS = 0.25  # metres from its shoulder within which a hand swings about that instead of passing it
_OPPOSITE = np.radians(170)  # about a shoulder, from which on no way about it is the one to take
_RISES = 0.35  # share of being led over which a hand only rises, and only sinks


def lead_to(
    hand: int, wrist: WristPose, seen: SeenBody, share: float, gripped: float = 1.0, closed: bool = False
) -> Lead:
    """Lead a ``hand`` (0 right, 1 left) by a ``share`` of its way from where the network has it, in a
    ``seen`` body, to a pose of its ``wrist``; turned as that is by the share ``gripped``.  It rises before it
    comes near, and goes off before it sinks: edges lie between hips and what stands on boards.  Where that
    leads close past its shoulder it swings about this: its arm would fold up and the elbow flip.
    """
    now, shoulder = seen.wrists[hand].astype(np.float64), seen.shoulders[hand].astype(np.float64)
    target = _past(lambda part: _risen(now, wrist.place, part), shoulder, share)
    palm = palm_of(wrist.rotation, (RIGHT, LEFT)[hand])
    bar = target + TO_HELD * wrist.towards + PALM * palm
    grip = Grip(palm, wrist.towards, np.asarray(bar), _ROOM, gripped, _SWIVEL)
    return Lead(hand, target, share, grip=grip, bends=True, closed=closed)


def _risen(now: Array, place: Array, share: float) -> Array:
    """The place (3,) a ``share`` of the way from ``now`` to a ``place``, both (3,), that rises first."""
    near, high = smooth_step((share - _RISES) / (1 - _RISES)), smooth_step(share / (1 - _RISES))
    return np.asarray(now + np.array((near, near, high)) * (place - now))


def _past(way: Callable[[float], Array], shoulder: Array, share: float) -> Array:
    """The place (3,) a ``share`` of a way, about a ``shoulder`` (3,) where it comes too close to that."""
    shares = np.linspace(0, 1, 21)
    away = np.array([float(np.linalg.norm(way(part) - shoulder)) for part in shares])
    inside = np.flatnonzero(away < _FOLDS)
    if not len(inside):
        return way(share)
    first, last = int(inside[0]), int(inside[-1])
    begin, end = 0.0, 1.0
    if first > 0:
        begin = float(np.interp(_FOLDS, away[[first, first - 1]], shares[[first, first - 1]]))
    if last < len(shares) - 1:
        end = float(np.interp(_FOLDS, away[[last, last + 1]], shares[[last, last + 1]]))
    if not begin < share < end:
        return way(share)
    return _swung(way(begin), way(end), shoulder, (share - begin) / (end - begin))


def _swung(start: Array, end: Array, shoulder: Array, share: float) -> Array:
    """The place (3,) a ``share`` of the way about a ``shoulder`` (3,) from ``start`` (3,) to ``end``."""
    ways = start - shoulder, end - shoulder
    far = [max(float(np.linalg.norm(way)), 1e-6) for way in ways]
    angle = float(np.arccos(np.clip(ways[0] @ ways[1] / (far[0] * far[1]), -1, 1)))
    if angle < 1e-3 or angle > _OPPOSITE:
        return np.asarray(start + share * (end - start))
    parts = np.sin((1 - share) * angle) / far[0], np.sin(share * angle) / far[1]
    way = (parts[0] * ways[0] + parts[1] * ways[1]) / np.sin(angle)
    return np.asarray(shoulder + (far[0] + share * (far[1] - far[0])) * way)


__all__ = ["lead_to"]
