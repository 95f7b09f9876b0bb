"""Where the ways of two characters meet, and who of them goes first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array

from .player import STEP, Player

AT_ONCE = 0.9  # seconds between two at one place that count as at the same time
SOON = 3.5  # seconds ahead within which ways that cross are looked at
TIE = 0.5  # seconds that decide nothing: the order does
NARROW = 0.72  # metres of room on the middle of a way under which two do not pass each other
ROOM = 0.08  # metres that are left between who waits and who goes by
PATIENCE = 900  # frames that one waits for a goal at most, all in all


@dataclass(frozen=True)
class Meeting:
    """Two ways that meet: the ``times`` (2,), seconds, at which each comes to where they do."""

    times: tuple[float, float]
    behind: int = (
        -1
    )  # which of the two follows the other the same way, -1 where they cross or face each other


def meeting(one: Player, other: Player) -> Meeting | None:
    """Where two who move would come too near to each other; None where they do not."""
    a, b = one.ahead, other.ahead
    if len(a.points) < 2 or len(b.points) < 2:
        return None
    near = _gaps(a.points, b.points) < one.radius + other.radius
    if not near.any():
        return None
    soon = (a.times[:, None] < SOON) & (b.times < SOON)
    clash = near & soon & (np.abs(a.times[:, None] - b.times) < AT_ONCE)
    # Two who face each other in a narrow place cannot both be in it, however long it is.
    facing = near & (_directions(a.points) @ _directions(b.points).T < -0.5)
    if facing.any():
        rows = np.flatnonzero(facing.any(1))
        room = one.runner.plan.clearance(one.frame.to_own(a.points[rows])) * one.frame.scale
        narrow = rows[room < NARROW * one.frame.scale]
        if len(narrow):
            cols = np.flatnonzero(facing[narrow].any(0))
            in_a, in_b = a.times[narrow], b.times[cols]
            if in_a.min() < in_b.max() + AT_ONCE and in_b.min() < in_a.max() + AT_ONCE:
                clash[np.ix_(narrow, cols)] |= facing[np.ix_(narrow, cols)]
    if not clash.any():
        return None
    rows, cols = np.nonzero(clash)
    first = tuple(
        float(times[_start_of_run(near.any(axis), int(index.min()))])
        for times, index, axis in ((a.times, rows, 1), (b.times, cols, 0))
    )
    return Meeting((first[0], first[1]), _behind(one, other))


def first_of(one: Player, other: Player, met: Meeting) -> Player | None:
    """Who of two goes first; None where neither can give way."""
    if one.at_work or other.at_work:
        return None if one.at_work and other.at_work else one if one.at_work else other
    if met.behind >= 0:
        return (other, one)[met.behind]
    if abs(met.times[0] - met.times[1]) > TIE:
        return one if met.times[0] < met.times[1] else other
    return one if one.order < other.order else other


def in_place_of(one: Player, other: Player) -> bool:
    """Whether ``one`` is about to leave the place where the way of ``other`` ends."""
    end = other.ahead.points[-1]
    within = one.radius + other.radius
    stands, stays = (float(np.linalg.norm(at - end)) < within for at in (one.place, one.ahead.points[-1]))
    return stands and not stays


def room_before(who: Player, other: Player) -> float:
    """Metres that ``who`` may go on without coming into the way of ``other``."""
    gap = _gaps(who.ahead.points, other.ahead.points).min(1)
    taken = np.flatnonzero(gap < who.radius + other.radius + ROOM)
    return np.inf if not len(taken) else max(0.0, (int(taken[0]) - 2) * STEP)


def clear_of(points: Array, others: list[Player], radius: float) -> Array:
    """Whether places (N, 2), common metres, lie clear of where ``others`` are and go; (N,)."""
    free = np.ones(len(points), dtype=bool)
    for other in others:
        ways = np.concatenate((other.ahead.points, other.place[None]))
        free &= _gaps(points, ways).min(1) > radius + other.radius + ROOM
    return free


def _behind(one: Player, other: Player) -> int:
    """Which of two who go the same way follows the other, -1 where they do not."""
    ways = [_directions(m.ahead.points[:6]).mean(0) for m in (one, other)]
    apart = other.place - one.place
    if float(ways[0] @ ways[1]) < 0.6 or float(np.linalg.norm(apart)) > 2.0:
        return -1
    along = float(apart @ (ways[0] + ways[1]))
    return 0 if along > 0.3 else 1 if along < -0.3 else -1


def _gaps(a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(a[:, None] - b, axis=-1))


def _directions(points: Array) -> Array:
    steps = np.gradient(points, axis=0)
    return np.asarray(steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-9))


def _start_of_run(near: Array, index: int) -> int:
    while index > 0 and near[index - 1]:
        index -= 1
    return index
