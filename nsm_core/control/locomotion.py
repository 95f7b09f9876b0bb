"""The low-level locomotion mode: a character that is steered, by keys or by anything that says where to go.

Section 4.1 of the paper: a wanted velocity and facing become a trajectory over the coming two seconds, from
the pace that the character has; every key is told where on it one will be a second later.  It keeps off what
is solid, slides along walls, and stops where it cannot go on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.conventions import DT, FPS
from nsm_core.rotations import Array
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.planning.path import Course

from .goals import Steering

_AHEAD = 2 * FPS  # frames of the trajectory
_EVERY = 3  # frames of it between two looks at what is solid
STANDS = 0.25  # m/s under which one may set off any way at once
_LEAST_TURN = 0.3  # m/s: the turn in a bend is not quicker than at this pace
_SHARP, _REVERSE, _BRAKED = (
    0.4,
    2.2,
    0.35,
)  # radians from which on a turn slows one down, to which, to what share
_AT_ONCE = 5.0  # 1/s: how soon a wanted direction is taken where nothing limits it


@dataclass(frozen=True)
class Answer:
    """How quickly a body answers: m/s2 by which it gains and loses speed, and is turned ``sideways``."""

    acceleration: float
    deceleration: float
    sideways: float


class Trajectory(Course):
    """Where one who is steered will be over the coming two seconds; laid anew every frame."""

    def __init__(self) -> None:
        super().__init__(np.zeros((2, 2)), 0.0)
        self._places, self._headings, self._paces = np.zeros((1, 2)), np.zeros(1), np.zeros(1)

    def advance(self, position: Array) -> None:
        """It begins where one is."""

    def preview(self, speed: float, frames: Sequence[int]) -> tuple[Array, Array, Array]:
        """Positions (n, 2), headings (n,) and paces (n,) at ``frames`` (n) from now, 60 at most."""
        at = np.minimum(frames, len(self._places) - 1)
        return self._places[at], self._headings[at], self._paces[at]

    def lay(
        self,
        here: Array,
        velocity: Array,
        heading: float,
        wanted: Steering,
        answer: Answer,
        floor: FloorPlan | None,
    ) -> None:
        """Lay it from ``here`` (2,) at ``velocity`` (2,) m/s and ``heading`` to what is ``wanted``."""
        laid = _led(here, velocity, heading, wanted, answer, None)
        if floor is not None and (floor.clearance(laid[0][_EVERY::_EVERY]) < floor.radius).any():
            laid = _led(here, velocity, heading, wanted, answer, floor)
        self._places, self._headings, self._paces = laid
        self.points, self.progress, self.speed = self._places, 0.0, max(wanted.speed, _LEAST_TURN)
        self._length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1)))


def _led(
    here: Array, velocity: Array, heading: float, wanted: Steering, answer: Answer, floor: FloorPlan | None
) -> tuple[Array, Array, Array]:
    """Places (61, 2), headings (61,) and paces (61,) of the coming two seconds, off solids of ``floor``."""
    pace, want = math.hypot(*velocity), wanted.speed
    way = _heading_of(velocity) if pace > STANDS else heading
    aim = _heading_of(wanted.velocity) if want > 0 else way
    if pace <= STANDS and want > 0:
        way = aim
    x, y = float(here[0]), float(here[1])
    last = np.array((x, y))
    places, headings, paces = [(x, y)], [heading], [pace]
    for frame in range(1, _AHEAD + 1):
        off = (aim - way + math.pi) % (2 * math.pi) - math.pi
        share = min(max((abs(off) - _SHARP) / (_REVERSE - _SHARP), 0.0), 1.0)
        change = want * (1 - (1 - _BRAKED) * share) - pace
        pace += min(max(change, -answer.deceleration * DT * (1 + share)), answer.acceleration * DT)
        most = answer.sideways / max(pace, _LEAST_TURN) * DT
        way += min(max(off * _AT_ONCE * DT, -most), most)
        x, y = x + pace * DT * math.sin(way), y - pace * DT * math.cos(way)
        if floor is not None and frame % _EVERY == 0:
            place, free = _kept_off(floor, last, np.array((x, y)))
            if 0 < free < 1:  # along a wall
                way = _heading_of(place - last)
            last = place
            x, y, pace = float(last[0]), float(last[1]), pace * free
        places.append((x, y))
        headings.append(way if want > 0 or pace > STANDS or wanted.heading is None else wanted.heading)
        paces.append(pace)
    return np.array(places), np.array(headings), np.array(paces)


def _heading_of(direction: Array) -> float:
    return math.atan2(float(direction[0]), -float(direction[1]))


def _kept_off(floor: FloorPlan, before: Array, place: Array) -> tuple[Array, float]:
    """A step from ``before`` to ``place`` (2,) that keeps off solids, along them where it must; and the share
    of the pace that is left.
    """
    room, old = floor.clearance(np.stack((place, before)))
    need = min(floor.radius, float(old))  # from beside a thing one may go, not nearer
    step = place - before
    if room >= need or not step.any():
        return place, 1.0
    away = floor.off_solids(place)
    along = step - min(0.0, float(step @ away)) * away
    slid = before + along
    if float(floor.clearance(slid[None])[0]) < need - 0.01:
        return before, 0.0
    return slid, float(np.linalg.norm(along) / np.linalg.norm(step))


__all__ = ["STANDS", "Answer", "Trajectory"]
