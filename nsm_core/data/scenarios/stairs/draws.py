"""What is drawn at random for flights of stairs, and how."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StairDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw, spreads are standard
    deviations; of pairs of whole numbers the second is never drawn.

    Metres, seconds, radians and frames; speeds in m/s.
    """

    up: float = 0.5  # share of flights that are gone up, the others are gone down
    steps: tuple[int, int] = (3, 13)
    riser: tuple[float, float] = (0.14, 0.2)
    tread: tuple[float, float] = (0.25, 0.32)
    width: tuple[float, float] = (0.8, 2.0)
    plates: float = 0.3  # share of flights whose treads are plates, the others are solid
    plate: tuple[float, float] = (0.03, 0.08)
    off_ahead: float = 0.5  # spread of the heading of a flight about where one faces
    off_square: float = 0.03  # spread of its heading about the way
    from_sides: float = 0.35  # metres that the way keeps from its sides, anywhere else along its width
    before: tuple[float, float] = (1.8, 2.8)  # metres of the level walk before it and behind it
    beyond: tuple[float, float] = (1.9, 2.8)
    speed: tuple[float, float] = (0.9, 1.2)  # of the level walk that is fitted to it
    rate_up: tuple[float, float] = (0.8, 0.95)  # of the walker's own pace in steps
    rate_down: tuple[float, float] = (0.85, 1.0)
    first_hold: int = 3  # of the first so many places at which the flight fits into the walk one is drawn
    short_of_riser: tuple[float, float] = (0.03, 0.13)  # toes before the lowest riser
    short_of_edge: tuple[float, float] = (0.0, 0.07)  # toes before the edge that is stepped down from
    landing: tuple[float, float] = (0.2, 0.28)  # toe joint behind the last riser
    off_place: float = 0.01  # spread of feet along a tread
    ahead_up: tuple[float, float] = (-0.17, -0.09)  # hips ahead of where level walks have them
    ahead_down: tuple[float, float] = (-0.07, 0.0)
    # Metres by which hips are higher over the floor that rises than over a level one: legs stretch more.
    taller_up: tuple[float, float] = (0.03, 0.06)
    taller_down: tuple[float, float] = (-0.01, 0.02)
    lean_up: tuple[float, float] = (0.05, 0.16)  # radians
    lean_down: tuple[float, float] = (-0.02, 0.06)
    led: float = 0.6  # share of short flights that are led along; long ones all are
    farthest: float = 3.4  # metres from which on one is led
    sent: float = 0.5  # share of those led along who are sent to their place from behind the flight
    stands: tuple[float, float] = (0.3, 1.2)


STAIRS = StairDraws()
# Landings, ahead of the flight and beside it on either side, metres: the largest that leaves the way clear.
LANDINGS = ((7.0, 4.0), (4.0, 2.5), (2.5, 1.0), (1.4, 0.4), (1.0, 0.0))
