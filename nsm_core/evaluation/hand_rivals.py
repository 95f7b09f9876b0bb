"""What plans ways of hands without learning, to compare the learnt planner with (papers/002 table 3): fast
marching, which made what it learnt from; A* over cells; minimum jerk with costs of collision; a straight
line.
"""

from __future__ import annotations

import heapq
from itertools import product

import numpy as np

from nsm_core.data.reaches.ways import HandTask, quickest
from nsm_core.rotations import Array
from nsm_core.signals import gaussian_smooth
from nsm_core.world.planning.hand_fields import CELL, SIDE, grid_around, told_at
from nsm_core.world.planning.hand_way import AMPLE, FROM, entry, radius_of, resampled, timed

PACE = 0.9  # m/s of a hand at most on ways that are not timed by who plans them
_NEIGHBOURS = [d for d in product((-1, 0, 1), repeat=3) if any(d)]
_CROWDED = 3.0  # metres that a metre without any room costs more
_STARTS, _CONTROLS, _STEPS, _SAMPLES = 8, 6, 150, 48  # of an optimised way
_APART = 0.1  # metres between the places where optimised ways begin
_COLLIDES, _RATE = 400.0, 0.01  # weight of the squared lack of room beside jerk; step of the descent, metres


def fast_marching(task: HandTask) -> Array | None:
    """The quickest way past everything, as in the data."""
    way = quickest(task)
    return None if way is None else timed(way, PACE)


def straight(task: HandTask) -> Array:
    """Straight from where the hand comes into the cube to where it goes into its grasp, and on."""
    return timed(np.stack((_edge(task), entry(task.wrist, task.laden), task.wrist.place)), PACE)


def a_star(task: HandTask) -> Array | None:
    """A* over cells, dearer where there is little room, to where the hand goes into its grasp; then smoothed
    as far as it stays free.
    """
    room, end = _room(task), task.to_own(entry(task.wrist, task.laden))
    free = room - radius_of(task.thing if task.laden else None)
    cost = 1 + _CROWDED * np.clip(1 - free / AMPLE, 0, 1)
    goal, begin = _cell(end), task.to_own(task.begin)
    centres = (np.indices(room.shape).transpose(1, 2, 3, 0) + 0.5) * CELL - SIDE / 2
    outer = np.linalg.norm(centres - end, axis=-1) > FROM
    for axis in range(3):
        np.moveaxis(outer, axis, 0)[[0, -1]] = True
    towards = np.linalg.norm(centres - begin, axis=-1)
    found = _searched(np.where(free < 0, np.inf, cost), goal, outer, towards)
    if found is None:
        return None
    way = np.concatenate((centres[tuple(found.T)][::-1][:-1], end[None]))
    way = resampled(way, 0.01)
    for wide in (12.0, 6.0, 3.0, 1.5):
        evened = np.concatenate((way[:1], gaussian_smooth(way, wide)[1:-1], way[-1:]))
        if (
            float((told_at(free, evened) - told_at(free, way)).min()) > -0.01
            and told_at(free, evened).min() > -0.01
        ):
            break
        evened = way
    return timed(np.concatenate((task.to_world(evened), task.wrist.place[None])), PACE)


def _searched(cost: Array, goal: tuple[int, ...], outer: Array, towards: Array) -> Array | None:
    """Cells (K, 3) from ``goal`` to the best at the edge, with its metres ``towards`` the hand."""
    best, came = {goal: 0.0}, {goal: goal}
    open_ = [(float(towards[goal]), goal)]
    shut: set[tuple[int, ...]] = set()
    size = len(cost)
    while open_:
        _, cell = heapq.heappop(open_)
        if cell in shut:
            continue
        shut.add(cell)
        if outer[cell]:
            way = [cell]
            while way[-1] != goal:
                way.append(came[way[-1]])
            return np.array(way[::-1])
        for step in _NEIGHBOURS:
            other = (cell[0] + step[0], cell[1] + step[1], cell[2] + step[2])
            if not all(0 <= n < size for n in other) or other in shut or cost[other] == np.inf:
                continue
            dear = best[cell] + CELL * np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2) * float(
                cost[other]
            )
            if dear < best.get(other, np.inf):
                best[other], came[other] = dear, cell
                heapq.heappush(open_, (dear + float(towards[other]), other))
    return None


def minimum_jerk(task: HandTask) -> Array:
    """The way of least jerk that keeps off solids: control points of a cubic B-spline go down the squared
    lack of room and the squared jerk, from several starts at once; the cheapest is kept.

    Equation as in cuRobo (Sundaralingam et al. 2023), for the wrist's path alone.
    """
    rng = np.random.default_rng(0)
    room, radius = _room(task), radius_of(task.thing if task.laden else None)
    begins, end = _begins(task, room - radius), task.to_own(entry(task.wrist, task.laden))
    base = _spline(_CONTROLS, _SAMPLES)
    share = np.linspace(0, 1, _CONTROLS)[:, None]
    points = begins[:, None] + share * (end - begins)[:, None]
    inner = slice(1, _CONTROLS - 1)
    points[1:, inner] += rng.normal(0, 0.06, (_STARTS - 1, 1, 3))
    third = np.diff(base, 3, axis=0) * _SAMPLES**2
    mean, square = np.zeros_like(points), np.zeros_like(points)
    for step in range(_STEPS + 1):
        way = base @ points
        lack, slope = _lacking(room, radius, way)
        jerk = third @ points
        cost = _COLLIDES * (lack**2).mean(1) + 0.02 * (jerk**2).sum(2).mean(1)
        if step == _STEPS:
            break
        down = base.T @ (-2 * _COLLIDES * lack[..., None] * slope / _SAMPLES)
        down += 0.04 * third.T @ jerk / len(third)
        down[:, [0, -1]] = 0
        mean, square = 0.9 * mean + 0.1 * down, 0.99 * square + 0.01 * down**2
        rate = _RATE * (1 - 0.8 * step / _STEPS)
        mended = mean / (1 - 0.9 ** (step + 1)), square / (1 - 0.99 ** (step + 1))
        points = points - rate * mended[0] / (np.sqrt(mended[1]) + 1e-9)
    best = way[int(cost.argmin())]
    return timed(np.concatenate((task.to_world(best), task.wrist.place[None])), PACE)


def _begins(task: HandTask, free: Array) -> Array:
    """Where (STARTS, 3) ways may begin: free places at the edge, near where the hand comes from, apart."""
    places = grid_around(np.zeros(3)).reshape(-1, 3)
    end, begin = task.to_own(entry(task.wrist, task.laden)), task.to_own(task.begin)
    outer = (np.abs(places).max(1) > SIDE / 2 - CELL) | (np.linalg.norm(places - end, axis=1) > FROM)
    places = places[outer & (free.ravel() > 0.01)]
    places = places[np.argsort(np.linalg.norm(places - begin, axis=1), kind="stable")]
    found = [task.to_own(_edge(task))]
    for place in places:
        if np.linalg.norm(np.array(found) - place, axis=1).min() > _APART:
            found.append(place)
        if len(found) == _STARTS:
            break
    return np.array(found + found[:1] * (_STARTS - len(found)))


def _lacking(room: Array, radius: float, way: Array) -> tuple[Array, Array]:
    """Metres (S, T) that lack to the room that ways (S, T, 3) want, and the slope (S, T, 3) of room."""
    flat = way.reshape(-1, 3)
    offs = np.concatenate((np.zeros((1, 3)), np.eye(3), -np.eye(3))) * CELL / 2
    told = told_at(room, (flat[:, None] + offs).reshape(-1, 3)).reshape(-1, 7)
    lack = np.maximum(radius + 0.01 - told[:, 0], 0)
    return lack.reshape(way.shape[:2]), ((told[:, 1:4] - told[:, 4:]) / CELL).reshape(way.shape)


def _spline(controls: int, samples: int) -> Array:
    """What points (samples, controls) of a clamped cubic B-spline are of its control points."""
    knots = np.concatenate((np.zeros(3), np.linspace(0, 1, controls - 2), np.ones(3)))
    at = np.linspace(0, 1 - 1e-9, samples)
    base = ((at[:, None] >= knots[:-1]) & (at[:, None] < knots[1:])).astype(float)
    for degree in (1, 2, 3):
        n = len(knots) - 1 - degree
        before, after = knots[:n], knots[degree + 1 : degree + 1 + n]
        left, right = knots[degree : degree + n] - before, after - knots[1 : 1 + n]
        a = np.where(left > 0, (at[:, None] - before) / np.where(left > 0, left, 1), 0)
        b = np.where(right > 0, (after - at[:, None]) / np.where(right > 0, right, 1), 0)
        base = a * base[:, :n] + b * base[:, 1 : n + 1]
    return base


def _room(task: HandTask) -> Array:
    """Metres (N, N, N) to what is in the hand's way."""
    space = task.space
    return space.to_obstacles if task.laden else np.minimum(space.to_obstacles, space.to_target)


def _edge(task: HandTask) -> Array:
    """Where (3,), world, a straight way from where the hand comes from meets the cube or its way in."""
    begin, end = task.to_own(task.begin), task.to_own(entry(task.wrist, task.laden))
    way = begin - end
    most = SIDE / 2 - CELL / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(way > 0, (most - end) / way, np.where(way < 0, (-most - end) / way, np.inf))
    share = min(1.0, float(shares.min()), FROM / max(float(np.linalg.norm(way)), 1e-6))
    return task.to_world(end + max(share, 0.2) * way)


def _cell(place: Array) -> tuple[int, ...]:
    return tuple(int(n) for n in np.clip((place + SIDE / 2) / CELL, 0, round(SIDE / CELL) - 1))


__all__ = ["a_star", "fast_marching", "minimum_jerk", "straight"]
