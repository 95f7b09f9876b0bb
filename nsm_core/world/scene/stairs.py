"""Flights of stairs: their treads, what feet stand on there, and the height of the floor that a walker
believes to stand on while climbing them.

A network that has learned to walk on stairs has seen them from a floor that rises evenly along the flight: it
goes through the middle of every tread, so that three steps and twelve look alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nsm_core.rotations import Array, heading_to_direction, rotate_planar

from .terrain import CELL, HeightMap, Terrain

# Metres: risers and treads of what is walked as stairs, and their least width.
RISERS, TREADS, LEAST_WIDTH = (0.1, 0.23), (0.2, 0.45), 0.55
LEAST_STEPS = 3
BLEND = 0.2  # metres to both sides over which the even rise begins and ends
APPROACH = 0.4  # metres before its ends from which on a way is one onto a flight
STEPS_A_SECOND = 1.7  # of walkers on stairs
ON_FLOOR = 0.05  # metres off a landing that still count as on it
_STANDS = 0.3  # metres that who stands on a landing may be off its height
BESIDE = 0.08  # metres beside the treads that still belong to a flight


@dataclass(frozen=True)
class Flight:
    """A straight flight of ``steps`` risers.

    ``foot`` (2,) the middle of the lowest riser's line, metres; ``heading`` of who goes up, radians;
    ``width`` across, ``tread`` the way from one riser to the next, ``riser`` its height, ``base`` that of
    the ground before the lowest one, metres.
    """

    foot: Array
    heading: float
    width: float
    tread: float
    riser: float
    steps: int
    base: float = 0.0

    @property
    def length(self) -> float:
        """Metres from the lowest riser to the highest."""
        return (self.steps - 1) * self.tread

    @property
    def rise(self) -> float:
        """Metres from the ground before it to that behind it."""
        return self.steps * self.riser

    @property
    def top(self) -> Array:
        """The middle (2,) of the highest riser's line."""
        return self.foot + self.length * heading_to_direction(np.array(self.heading))

    def local(self, points: Array) -> Array:
        """Floor points (..., 2) as metres along the flight, from the lowest riser, and to its left."""
        own = rotate_planar(np.asarray(points, dtype=np.float64) - self.foot, np.float64(-self.heading))
        return np.stack((-own[..., 1], own[..., 0]), axis=-1)

    def at(self, along: float, aside: float = 0.0) -> Array:
        """The floor point (2,) so many metres along the flight and to its left."""
        return self.foot + rotate_planar(np.array((aside, -along)), np.float64(self.heading))

    def level(self, along: Array) -> Array:
        """Heights (...) of the even rise at metres ``along`` (...) the flight."""
        slope, first = self.riser / self.tread, -self.tread / 2
        last = first + self.steps * self.tread

        def bend(x: Array) -> Array:
            """A slope of 1 that begins at 0, evened over ``BLEND`` to both sides."""
            return (np.maximum(x + BLEND, 0) ** 2 - np.maximum(x - BLEND, 0) ** 2) / (4 * BLEND)

        along = np.asarray(along, dtype=np.float64)
        return self.base + slope * (bend(along - first) - bend(along - last))

    def heights(self, along: Array) -> Array:
        """Heights (...) of ground, treads and landing at metres ``along`` (...) the flight."""
        steps = np.clip(np.floor(np.asarray(along, dtype=np.float64) / self.tread + 1e-9) + 1, 0, self.steps)
        return self.base + self.riser * steps

    def holds(self, points: Array, margin: float = 0.0) -> Array:
        """Whether floor points (..., 2) lie on the flight, ``margin`` metres longer at both ends."""
        own = self.local(points)
        beside = np.abs(own[..., 1]) <= self.width / 2 + BESIDE
        return beside & (own[..., 0] > -margin) & (own[..., 0] < self.length + margin)

    def treads(self) -> HeightMap:
        """The heights of its treads, without the landing."""
        across = np.arange(-self.width / 2 + CELL / 2, self.width / 2, CELL)
        along = np.arange(CELL / 2, max(self.length, CELL), CELL)
        # The frame of the map has the flight go up along its -Y, as headings do.
        heights = np.repeat(self.heights(along[::-1])[None], len(across), axis=0)
        return HeightMap(self.at(float(along[-1]), float(across[0])), self.heading, heights)


class FlightGround(Terrain):
    """The ground of one flight, before and behind it as far as one goes: what feet are fitted to."""

    def __init__(self, flight: Flight) -> None:
        super().__init__([flight.treads()])
        self.flight = flight

    def height(self, points: Array) -> Array:
        """Heights (N,) at floor points (N, 2)."""
        return self.flight.heights(self.flight.local(points)[..., 0])


class Stairs:
    """Flights of a scene and the ``landings`` between and behind them, which are walked on; without any the
    floor is flat.
    """

    def __init__(self, flights: Sequence[Flight] = (), landings: Iterable[HeightMap] = ()) -> None:
        self.flights, self.landings = tuple(flights), tuple(landings)

    def __bool__(self) -> bool:
        return bool(self.flights)

    @cached_property
    def terrain(self) -> Terrain:
        """What feet stand on: treads and landings."""
        return Terrain((*(flight.treads() for flight in self.flights), *self.landings))

    @cached_property
    def _raised(self) -> Terrain:
        return Terrain(self.landings)

    def level(self, points: Array) -> Array:
        """Heights (N,) of the floor that a walker at floor points (N, 2) believes to stand on."""
        points = np.asarray(points, dtype=np.float64)
        out = self._raised.height(points)
        for flight in self.flights:
            on = flight.holds(points, flight.tread / 2 + BLEND)
            out[on] = flight.level(flight.local(points[on])[:, 0])
        return out

    def heights(self, points: Array) -> Array:
        """Heights (N,) of what feet at floor points (N, 2) stand on, 0 on the floor."""
        return self.terrain.height(np.asarray(points, dtype=np.float64))

    def on(self, points: Array) -> Array:
        """Whether floor points (N, 2) lie on a flight, or before an end of one."""
        points = np.asarray(points, dtype=np.float64)
        return np.any([flight.holds(points, APPROACH) for flight in self.flights], axis=0)

    def lead_to(self, place: Array) -> bool:
        """Whether a place (3,) lies on a landing, or at the end of a flight, over the floor."""
        height = float(self.level(np.asarray(place, dtype=np.float64)[None, :2])[0]) if self else 0.0
        return height > ON_FLOOR and abs(float(place[2]) - height) < ON_FLOOR

    def asked_for(self, start: Array, places: Iterable[Array]) -> Stairs:
        """These stairs where one who stands at ``start`` (3,) has to walk on them to come to ``places`` (3,);
        else none: on the floor under a landing all is as it is without them.
        """
        level = float(self.level(np.asarray(start, dtype=np.float64)[None, :2])[0]) if self else 0.0
        stands_up = level > ON_FLOOR and abs(float(start[2]) - level) < _STANDS
        if level > ON_FLOOR and not stands_up:
            return Stairs()
        return self if stands_up or any(self.lead_to(place) for place in places) else Stairs()

    def pace(self, points: Array, speed: float) -> Array:
        """Speeds (N,), m/s, at which a walker of ``speed`` is at floor points (N, 2): slower on flights."""
        points = np.asarray(points, dtype=np.float64)
        out = np.full(len(points), speed)
        for flight in self.flights:
            on = flight.holds(points, flight.tread / 2)
            out[on] = np.minimum(out[on], STEPS_A_SECOND * flight.tread)
        return out


__all__ = [
    "APPROACH",
    "BLEND",
    "LEAST_STEPS",
    "LEAST_WIDTH",
    "ON_FLOOR",
    "RISERS",
    "TREADS",
    "FlightGround",
    "Flight",
    "Stairs",
]
