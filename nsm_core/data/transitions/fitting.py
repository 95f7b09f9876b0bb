"""Ground fitted under a window of motion (papers/001 section 3.3, after the fitting of phase-functioned
networks): heightmaps, placed by chance, are judged by where feet touch them, pass through them and float; the
best are bent until feet stand on them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import ANKLES, RESTING, TOES
from nsm_core.body.skeleton import ANKLE_HEIGHT, TOE_HEIGHT
from nsm_core.conventions import FPS
from nsm_core.rotations import Array
from nsm_core.signals import intervals

from .ground import Grounds, gaussian, logistic, looked_up
from .heightmaps import CELL, SIDE

KEPT = 5  # heightmaps of a window
PLACED = 8  # ways in which each map is tried
CONTACTS = 24  # stands of a foot's parts in a window at most; the longest are kept
RIDGE = 0.05  # by which stands may be missed where two near ones differ in height
_SOLES = (*((t, TOE_HEIGHT) for t in TOES), *((a, ANKLE_HEIGHT) for a in ANKLES))


@dataclass
class Feet:
    """Undersides of a window's toes and heels: ``points`` (T, 4, 3), which of them ``touch`` (T, 4), and the
    middles of their ``stands`` (C, 3).
    """

    points: Array
    touch: Array
    stands: Array


def feet_of(positions: Array) -> Feet:
    """Where feet touch, by their speed: of world joints (T, 23, 3)."""
    joints = [joint for joint, _ in _SOLES]
    points = positions[:, joints].astype(np.float64)
    points[..., 2] -= [height for _, height in _SOLES]
    touch = np.linalg.norm(np.gradient(points, axis=0), axis=-1) * FPS < RESTING
    stands = []
    for k in range(len(joints)):
        stands += [(b - a, points[a:b, k].mean(0)) for a, b in intervals(touch[:, k])]
    stands.sort(key=lambda stand: -stand[0])
    middles = [middle for _, middle in stands[:CONTACTS]]
    return Feet(points, touch, np.array(middles).reshape(-1, 3))


def cost(heights: Array, feet: Feet) -> Array:
    """How ill (...) ground of ``heights`` (..., T, 4) under the feet suits them, square metres: feet that
    touch it float over it or are inside it, others pass through it.
    """
    over = feet.points[..., 2] - heights
    apart = np.where(feet.touch, over, np.minimum(over, 0.0))
    return np.asarray((apart**2).mean((-2, -1)))


def fitted(positions: Array, maps: Array, rng: np.random.Generator) -> Grounds:
    """The KEPT grounds that suit the world joints (T, 23, 3) of a window best, bent to them."""
    feet = feet_of(positions)
    # One heightmap is tried in PLACED ways, and each is lifted to where feet touch it.
    which = np.repeat(np.arange(len(maps)), PLACED)
    turn, shift = rng.uniform(-np.pi, np.pi, len(which)), rng.uniform(0, SIDE * CELL, (len(which), 2))
    flat = feet.points[..., :2].reshape(-1, 2)
    heights = looked_up(maps, which, turn, shift, np.broadcast_to(flat, (len(which), *flat.shape)))
    heights = heights.reshape(len(which), *feet.touch.shape)
    weight = feet.touch if feet.touch.any() else np.ones_like(feet.touch)
    lift = ((feet.points[..., 2] - heights) * weight).sum((-2, -1)) / weight.sum()
    judged = cost(heights + lift[:, None, None], feet)
    best: list[int] = []
    for k in np.argsort(judged, kind="stable"):
        if which[k] not in which[best]:  # five different maps
            best.append(int(k))
        if len(best) == KEPT:
            break
    places = np.zeros((CONTACTS, 2))
    places[: len(feet.stands)] = feet.stands[:, :2]
    none, places = np.zeros((len(best), CONTACTS)), np.repeat(places[None], len(best), 0)
    grounds = Grounds(which[best], turn[best], shift[best], lift[best], places, none, none.copy())
    return _bent(grounds, feet, maps)


def _bent(grounds: Grounds, feet: Feet, maps: Array) -> Grounds:
    """Grounds on which the stands of feet lie: by radial basis functions, and by the filter of equation 1
    where that makes nothing worse.
    """
    count = len(feet.stands)
    if not count:
        return grounds
    at, kept = feet.stands[:, :2], len(grounds.map)
    lack = feet.stands[:, 2] - grounds.height(maps, np.broadcast_to(at, (kept, count, 2)))
    between = tuple(at[:, None, k] - at[:, k] for k in (0, 1))
    grounds.radial[:, :count] = np.linalg.solve(logistic(*between) + RIDGE * np.eye(count), lack.T).T
    flat = feet.points[..., :2].reshape(-1, 2)
    under = grounds.height(maps, np.broadcast_to(flat, (kept, *flat.shape)))
    under = under.reshape(kept, *feet.touch.shape)
    lack = feet.stands[:, 2] - grounds.height(maps, np.broadcast_to(at, (kept, count, 2)))
    judged, bumps = cost(under, feet), gaussian(*between)
    there = gaussian(*(flat[:, None, k] - at[:, k] for k in (0, 1))).reshape(*feet.touch.shape, count)
    for k in range(count):
        raised = under + lack[:, k, None, None] * there[..., k]
        score = cost(raised, feet)
        better = score <= judged
        add = np.where(better, lack[:, k], 0.0)
        grounds.filtered[:, k] = add
        under = np.where(better[:, None, None], raised, under)
        judged = np.where(better, score, judged)
        lack = lack - add[:, None] * bumps[k]
    return grounds


__all__ = ["CONTACTS", "KEPT", "Feet", "cost", "feet_of", "fitted"]
