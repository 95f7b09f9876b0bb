"""The way of a hand to a thing, planned: the latent code of what stands there is found, and the wrist goes
down the field of arrival that the network then tells (papers/002 equations 9 to 12).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.conventions import DT
from nsm_core.model.inference.field_model import STEPS, FieldModel, FoundCode, KnownFields
from nsm_core.rotations import Array
from nsm_core.signals import gaussian_smooth
from nsm_core.world.planning.hand_fields import (
    CELL,
    NEAREST,
    SIDE,
    SOONEST,
    HandSpace,
    grid_around,
    straight_in,
    told_at,
)
from nsm_core.world.planning.hand_way import FROM, STRAIGHT, entry, radius_of, turned_along
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.wrist import WristPose

FASTEST, SLOWEST = 1.4, 0.12  # m/s that a wrist is taken along at, at most and at least
SLOW = 0.8  # m/s: the mean that the way to where a plan begins is measured by (v of equation 11)
MOST = 120  # frames of a plan
_LATE = 4.0  # seconds from which on nothing is told of arrival that a wrist could go by
_LENGTH, _SECONDS = 0.5, 1.0  # metres and seconds of a way whose end is known
_HOME = 0.09  # metres from where the known end begins within which that leads
_EVEN = 2.0  # frames by which a plan is evened out
_PUSHED = 0.012  # metres a frame by which a wrist is pushed off solids at most
_CLOSE = 0.03  # metres between a wrist and solids at which it is pushed off where the known end begins


@dataclass(frozen=True)
class LikeWay:
    """The end of a way that is known beforehand, as the grasp has it: ``path`` (M, 3) at 30 Hz into it and
    its ``rotations`` (M, 3, 3); both in the frame of the plan.
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


@dataclass(frozen=True)
class HandScene:
    """What a plan is made among: the ``known`` fields; ``room`` (N, N, N) metres to solids at their points,
    and the ``radius`` of what is to be kept off them.
    """

    known: KnownFields
    room: Array
    radius: float


def known_end(wrist: WristPose, laden: bool) -> LikeWay:
    """The end of a way into the grasp of a ``wrist``, from where it is straight, as smoothly as a longer way
    comes to rest (minimum jerk); the wrist has its rotation all along.
    """
    way = wrist.place - entry(wrist, laden)
    far = float(np.linalg.norm(way))
    line = straight_in(WristPose(wrist.place, wrist.rotation), _LENGTH, _SECONDS)
    left = np.linalg.norm(line - wrist.place, axis=1)
    left = np.concatenate(([far], left[left < far - 1e-3]))
    path = wrist.place - left[:, None] * way / far
    return LikeWay(path, np.repeat(wrist.rotation[None], len(path), 0))


def hand_scene(space: HandSpace, like: LikeWay, held: LightThing | None) -> HandScene:
    """What is known before a plan (equation 9): both distances, no arrival in solids, and the end of a way
    like this one; ``held`` what is in the hand, or None: the thing itself is then in its way.
    """
    points = grid_around(np.zeros(3))
    solid = points[space.obstacles >= 1 / NEAREST - 1e-3]
    # As many of either, lest solids, of which there are more, drown what leads.
    often = max(1, len(solid) // len(like.path))
    known = KnownFields(
        points,
        space.target,
        space.obstacles,
        np.concatenate((solid, np.repeat(like.path, often, axis=0))),
        np.concatenate((np.zeros(len(solid)), np.repeat(like.arrival(), often))),
    )
    room = space.to_obstacles if held is not None else np.minimum(space.to_obstacles, space.to_target)
    return HandScene(known, room, radius_of(held))


def plan_way(
    model: FieldModel,
    around: HandScene,
    condition: Array,
    task: Array,
    like: LikeWay,
    steps: int = STEPS,
    guess: bool = True,
    keep_off: bool = True,
    seed: int = 0,
) -> HandPlan:
    """Plan the way of a wrist, all in the frame of the known fields; ``condition`` (4,) and ``task`` (9,) as
    ``field_config.CONDITION`` and ``TASK``; the code is looked for in ``steps`` from a ``guess`` or not.

    ``keep_off``: beside going down the field the wrist is pushed off solids that are nearer than its radius,
    which are known (beyond the paper, whose ways clear what the network has understood of them).
    """
    found = model.find_code(around.known, condition, task, steps=steps, guess=guess, seed=seed)
    begin = _begin(model, around, condition, found.code, task[6:].astype(np.float64), like.path[-1])
    path, arrived = _descended(model, around, condition, found.code, begin, like.path[0], keep_off)
    path = np.concatenate((path, like.path[1:]))
    path = np.concatenate((path[:1], gaussian_smooth(path, _EVEN)[1:-1], path[-1:]))
    return HandPlan(path, turned_along(path, like.path, like.rotations), arrived, found)


def _begin(
    model: FieldModel, around: HandScene, condition: Array, code: Array, begin: Array, end: Array
) -> Array:
    """Where (3,) a plan begins that comes from ``begin`` (3,): there, or where the way to it and on is the
    soonest of all places at the edge of the cube and beyond ``FROM`` (equation 11, whose remaining time we
    add, not subtract: the latest place of all is no good one to begin at).
    """
    if (np.abs(begin) < SIDE / 2 - CELL).all() and model.arrival(begin[None], condition, code)[0][
        0
    ] > 1 / _LATE:
        return begin
    every = (slice(None, None, 2),) * 3
    places, room = around.known.points[every].reshape(-1, 3), around.room[every].ravel()
    late = 1 / np.maximum(model.fields(places, condition, code)[:, 2], 1e-3)
    outer = (np.abs(places).max(1) > SIDE / 2 - 2 * CELL) | (np.linalg.norm(places - end, axis=1) > FROM)
    cost = np.where(
        outer & (room > around.radius), late + np.linalg.norm(places - begin, axis=1) / SLOW, np.inf
    )
    k = int(cost.argmin())
    return places[k] if cost[k] < np.inf else np.clip(begin, -SIDE / 2, SIDE / 2)


def _descended(
    model: FieldModel,
    around: HandScene,
    condition: Array,
    code: Array,
    place: Array,
    end: Array,
    keep_off: bool,
) -> tuple[Array, bool]:
    """The way (T, 3) down the field of remaining time from a place (3,), and whether it comes to its end.

    The velocity is the slope of the remaining time over its squared length: as fast as the field says, the
    steepest way (equation 10, whose inverse of each coordinate has no bound where one is 0).
    """
    found = [place]
    for _ in range(MOST):
        way = end - found[-1]
        far = float(np.linalg.norm(way))
        if far < 0.6 * CELL:
            return np.array([*found, end]), True
        told, slope = model.arrival(found[-1][None], condition, code)
        late = 1 / max(float(told[0]), 1 / _LATE)
        down = late**2 * slope[0]  # minus the slope of 1 / told
        steep = float(np.linalg.norm(down))
        speed = float(np.clip(1 / max(steep, 1e-6), SLOWEST, FASTEST))
        if steep < 1e-6 or far < _HOME:
            down, steep = way, far
            speed = SLOW / 2
        step = min(speed * DT, far) * down / steep
        found.append(_kept_off(around, found[-1] + step, far) if keep_off else found[-1] + step)
    return np.array([*found, end]), False


def _kept_off(around: HandScene, place: Array, far: float) -> Array:
    """A place (3,) pushed off solids that are nearer than the radius; less so where the known end is near."""
    offs = np.concatenate((np.zeros((1, 3)), np.eye(3), -np.eye(3))) * CELL / 2
    room = told_at(around.room, place + offs)
    lack = _CLOSE + (around.radius - _CLOSE) * min(far / STRAIGHT, 1.0) - float(room[0])
    away = room[1:4] - room[4:]
    steep = float(np.linalg.norm(away))
    if lack <= 0 or steep < 1e-6:
        return place
    return np.asarray(place + min(lack, _PUSHED) * away / steep)


__all__ = ["HandPlan", "LikeWay", "HandScene", "known_end", "plan_way", "hand_scene"]
