"""The ways of hands onto things and off them: over the edges of what lies between, and round the corners of a
box.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nsm_core.body.skeleton import ARMS, END_SITES, JOINTS
from nsm_core.rotations import Array, Scalars, quat_mul, quat_rotate
from nsm_core.world.geometry.distance import DistanceQuery

from .two_bone import chain_frames

UP, OUT = (
    (0.0, 0.06, 0.12, 0.18, 0.25),
    (0.0, 0.06, 0.12, 0.18),
)  # metres off the straight way, in its middle, that are tried
MARGIN = 0.015  # metres between a hand on its way and what it goes round
EASE, SPEED = 0.4, 0.04  # share of the change and metres a frame by which that changes
_PRICE = 0.05  # metres inside a solid that a metre off the straight way is worth
_ALONG, _RADII = (
    np.array((0.0, 0.5, 1.0)),
    np.array((0.03, 0.022, 0.016)),
)  # from the wrist to the tips of the fingers, and how thick
_UNREADY, _LEAST_PACE = (
    0.08,
    0.1,
)  # metres that a way is off what it must be at which hands wait; the pace at which they then go
_LAST = 0.85  # share of the way from which on a hand is at the thing itself
_TIPS = np.array([END_SITES[JOINTS[arm[2]]] for arm in ARMS], dtype=np.float64)


class HandWays:
    """Bends the ways of the hands of one hold, smoothly; one call a frame."""

    def __init__(self, hands: list[int], least: float = 0.0) -> None:
        """``least`` metres that ways go off the straight line in any case."""
        self.hands, self.least = hands, least
        self._off = np.array((least, least))  # up and outward now
        self.ready = 1.0  # 0..1: how far the way is bent as it must be; hands wait for that

    def off_the_line(
        self,
        hips: Array,
        local: Array,
        now: Array,
        to: Array,
        share: float,
        places: Array,
        solids: DistanceQuery | None,
        back: bool,
    ) -> Array:
        """Metres (n, 3) by which hands that are a ``share`` of the way from ``now`` to ``to`` (n, 3), or
        ``back``, are to be off it.

        ``hips`` (3,) and ``local`` rotations (23, 4) tell how the hands are turned, ``places`` (n, 3) how the
        thing lies.
        """
        ways = _directions(places)
        if solids is not None and 0 < share < 1:
            wanted = self._wanted(
                self._fingers(hips, local), now, to, (share, 0.0 if back else max(_LAST, share)), ways, solids
            )
            self._off = self._off + np.clip(EASE * (wanted - self._off), -SPEED, SPEED)
            self.ready = float(np.clip(1 - (wanted - self._off).max() / _UNREADY, _LEAST_PACE, 1))
        elif share in (0.0, 1.0):
            self._off, self.ready = np.full(2, self.least), 1.0
        return _bow(np.float64(share)) * np.tensordot(self._off, ways, 1)

    def _fingers(self, hips: Array, local: Array) -> Array:
        """From the wrists to the tips of the fingers (n, 3), world."""
        arms = [ARMS[h] for h in self.hands]
        rotation = chain_frames(hips, local, tuple(arm[0] for arm in arms))[1]
        for k in range(3):
            rotation = quat_mul(rotation, local[[arm[k] for arm in arms]])
        return quat_rotate(rotation, _TIPS[self.hands])

    def _wanted(
        self,
        fingers: Array,
        now: Array,
        to: Array,
        rest: tuple[float, float],
        ways: Array,
        solids: DistanceQuery,
    ) -> Array:
        """The least (2,) up and outward with which the ``rest`` of the way is free."""
        tries = np.array([(u, o) for u in UP for o in OUT if len(self.hands) > 1 or not o])
        tries = np.maximum(tries, self.least)
        shares = np.linspace(*rest, 6)[:, None, None]
        line = now + shares * (to - now)  # (shares, n, 3)
        wrists = line + _bow(shares) * np.tensordot(tries, ways, 1)[:, None]  # (tries, shares, n, 3)
        points = wrists[..., None, :] + _ALONG[:, None] * fingers[:, None]
        distance = solids.signed_distance(points.reshape(-1, 3).astype(np.float32), 0.1).reshape(
            points.shape[:-1]
        )
        deep = np.maximum(0, _RADII + MARGIN - distance).max(axis=(1, 2, 3))
        return tries[(deep + _PRICE * tries.sum(1)).argmin()]


def _bow(share: Scalars) -> Any:
    """How far a way is off its line, 0..1: soon, for what is in the way mostly lies close before a hand."""
    return np.sqrt(4 * share * (1 - share))


def _directions(places: Array) -> Array:
    """Up and outward (2, n, 3) at ``places`` (n, 3): hands go over edges, and two of them round corners."""
    up = np.broadcast_to((0.0, 0.0, 1.0), places.shape)
    if len(places) == 1:
        return np.stack((up, np.zeros_like(up)))
    across = places[1] - places[0]
    across = across / max(float(np.linalg.norm(across)), 1e-9)
    return np.stack((up, np.stack((-across, across))))


__all__ = ["HandWays"]
