"""The way of a hand to a thing, planned: the latent code of what stands there is found, and the wrist goes
down the field of arrival that the network then tells (papers/002 equations 9 to 12).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.conventions import DT
from nsm_core.model.inference.field_model import FieldModel, FoundCode, KnownFields
from nsm_core.rotations import Array
from nsm_core.signals import gaussian_smooth, smooth_step
from nsm_core.world.planning.hand_fields import CELL, NEAREST, SOONEST
from nsm_core.world.planning.hand_way import turned_along

FASTEST, SLOWEST = 1.4, 0.12  # m/s that a wrist is taken along at, at most and at least
SLOW = 0.8  # m/s: the mean that the way to where a plan begins is measured by (v of equation 11)
MOST = 120  # frames of a plan
NEAR = 0.05  # metres from the thing within which a way like this one is known
_LATE = 3.0  # seconds from which on nothing is told of arrival that a wrist could go by
_HOME = 0.06  # metres from the end within which what is known leads
_EVEN = 1.5  # frames by which a plan is evened out


@dataclass(frozen=True)
class LikeWay:
    """A way that has been gone under like conditions: ``path`` (M, 3) that ends where the wrist is to end,
    and its ``rotations`` (M, 3, 3); both in the frame of the plan.
    """

    path: Array
    rotations: Array

    def arrival(self) -> Array:
        """The field of arrival (M,) along it, one over seconds."""
        left = np.arange(len(self.path))[::-1] * DT
        return 1 / np.maximum(left, SOONEST)


@dataclass(frozen=True)
class HandPlan:
    """``path`` (T, 3) of the wrist at 30 Hz, to the thing, and ``rotations`` (T, 3, 3); to leave, both are
    gone backwards.  ``arrived`` tells whether the field led all the way.
    """

    path: Array
    rotations: Array
    arrived: bool
    found: FoundCode


def known_fields(points: Array, target: Array, obstacles: Array, like: LikeWay) -> KnownFields:
    """What is known before a plan (equation 9): fields ``target`` and ``obstacles`` (N, N, N) at ``points``
    (N, N, N, 3), no arrival in solids, and a way like this one's near the thing.
    """
    solid = points[obstacles >= 1 / NEAREST - 1e-3]
    told = like.arrival()
    off = np.abs(points[:, 0, 0, 0][:, None] - like.path[:, 0]).argmin(0)
    aside = np.abs(points[0, :, 0, 1][:, None] - like.path[:, 1]).argmin(0)
    up = np.abs(points[0, 0, :, 2][:, None] - like.path[:, 2]).argmin(0)
    near = target[off, aside, up] > 1 / NEAR
    near[-3:] = True  # a wrist holds what it holds from a hand's length away
    # As many of either, lest solids, of which there are more, drown what leads.
    prior = np.repeat(like.path[near], max(1, len(solid) // max(int(near.sum()), 1)), axis=0)
    arrival = np.repeat(told[near], max(1, len(solid) // max(int(near.sum()), 1)))
    return KnownFields(
        points,
        target,
        obstacles,
        np.concatenate((solid, prior)),
        np.concatenate((np.zeros(len(solid)), arrival)),
    )


def plan_way(
    model: FieldModel, known: KnownFields, condition: Array, begin: Array, like: LikeWay, steps: int = 40
) -> HandPlan:
    """Plan the way of a wrist from near ``begin`` (3,) to the end of a way ``like`` this one, all in the
    frame of the known fields; ``condition`` (4,) as ``field_config.CONDITION``.
    """
    found = model.find_code(known, condition, steps=steps)
    places = known.points.reshape(-1, 3)
    told = model.fields(places, condition, found.code)[:, 2]
    late = 1 / np.maximum(told, 1e-3)
    end = like.path[-1]
    outer = (late < _LATE) & (known.obstacles.reshape(-1) < 1 / (2 * NEAREST))
    cost = np.where(outer, -late + np.linalg.norm(places - begin, axis=1) / SLOW, np.inf)
    place = places[int(cost.argmin())] if outer.any() else begin
    path, arrived = _descended(model, condition, found.code, place, end)
    path = np.concatenate((path[:1], gaussian_smooth(path, _EVEN)[1:-1], path[-1:]))
    # At its end the way is the one that is known, so that the hand meets the thing as it did there.
    n = min(len(path), len(like.path), 8)
    share = smooth_step((np.arange(n) + 1) / n)[:, None]
    path[-n:] = (1 - share) * path[-n:] + share * like.path[-n:]
    return HandPlan(path, turned_along(path, like.path, like.rotations), arrived, found)


def _descended(
    model: FieldModel, condition: Array, code: Array, place: Array, end: Array
) -> tuple[Array, bool]:
    """The way (T, 3) down the field of remaining time from a place (3,), and whether it comes to its end.

    The velocity is the slope of the remaining time over its squared length: as fast as the field says, the
    steepest way (equation 10, whose inverse of each coordinate has no bound where one is 0).
    """
    found = [place]
    for _ in range(MOST):
        way = end - found[-1]
        far = float(np.linalg.norm(way))
        if far < CELL:
            break
        told, slope = model.arrival(found[-1][None], condition, code)
        late = 1 / max(float(told[0]), 1e-3)
        down = late**2 * slope[0]  # minus the slope of 1 / told
        steep = float(np.linalg.norm(down))
        if steep < 1e-6 or far < _HOME:
            down, steep = way / far, far / (far * SLOW)
        speed = np.clip(1 / max(steep, 1e-6), SLOWEST, FASTEST)
        found.append(found[-1] + min(speed * DT, far) * down / np.linalg.norm(down))
    arrived = bool(np.linalg.norm(found[-1] - end) < 2 * CELL)
    return np.array([*found, end]), arrived


__all__ = ["HandPlan", "LikeWay", "known_fields", "plan_way"]
