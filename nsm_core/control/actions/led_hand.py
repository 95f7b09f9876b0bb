"""A hand that is led by its planned pose: what a frame asks of it."""

from __future__ import annotations

import numpy as np

from nsm_core.body.capsules import BUNDLED
from nsm_core.body.ik.grip import FINGERTIP, PALM, Grip
from nsm_core.rotations import Array
from nsm_core.signals import smooth_step
from nsm_core.world.affordances.reach import LEFT, RIGHT
from nsm_core.world.scene.wrist import TO_HELD, WristPose, palm_of

from .hold import Lead

# Metres before what lies across the palm that fingers reach: the bundled hand's.
_ROOM = BUNDLED.hand + FINGERTIP - TO_HELD
# A planned hand turns little about what it holds: the wrist would leave the way that has room for it.
_SWIVEL = np.radians(10)
_RISES = 0.35  # share of being led over which a hand only rises, and only sinks


def lead_to(
    hand: int, wrist: WristPose, now: Array, share: float, gripped: float = 1.0, closed: bool = False
) -> Lead:
    """Lead a ``hand`` (0 right, 1 left) by a ``share`` of its way from ``now`` (3,), where the network has
    it, to a pose of its ``wrist``; turned as that is by the share ``gripped``.  It rises before it comes
    near, and goes off before it sinks: edges lie between hips and what stands on boards.
    """
    near, high = smooth_step((share - _RISES) / (1 - _RISES)), smooth_step(share / (1 - _RISES))
    target = now + np.array((near, near, high)) * (wrist.place - now)
    palm = palm_of(wrist.rotation, (RIGHT, LEFT)[hand])
    bar = target + TO_HELD * wrist.towards + PALM * palm
    grip = Grip(palm, wrist.towards, np.asarray(bar), _ROOM, gripped, _SWIVEL)
    return Lead(hand, target, share, grip=grip, bends=True, closed=closed)


__all__ = ["lead_to"]
