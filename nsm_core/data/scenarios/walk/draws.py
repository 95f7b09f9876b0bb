"""What is drawn at random for walks and runs, and how."""

from __future__ import annotations

from dataclasses import dataclass

from nsm_core.distances import RUN_AT


@dataclass(frozen=True)
class WalkDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw, spreads are standard
    deviations.

    Metres, seconds, radians and frames.
    """

    near: float = 0.3  # share of steps and turns on the spot
    near_place: tuple[float, float] = (0.1, 0.9)  # metres from here
    place: tuple[float, float] = (0.9, 4.0)
    off_the_way: float = 0.8  # spread of the heading at the end about the way there
    led: float = 0.5  # share that is led along, a second ahead; the others are sent there
    interrupted: float = 0.6  # share of the long ones that are led
    long: int = 60  # frames from which a walk may be interrupted
    earliest: int = 25  # frames after which, and
    latest: int = 15  # frames before its end until which it then breaks off
    stands: tuple[float, float] = (0.3, 1.5)  # seconds at the end


@dataclass(frozen=True)
class RunDraws:
    """As ``WalkDraws``; speeds in m/s, accelerations in m/s2."""

    place: tuple[float, float] = (4.0, 10.0)
    off_the_way: float = 0.5
    speed: tuple[float, float] = RUN_AT
    acceleration: tuple[float, float] = (1.8, 2.8)
    deceleration: tuple[float, float] = (1.4, 2.4)
    turn_distance: float = 1.0
    interrupted: float = 0.35
    long: int = 70
    earliest: int = 30
    latest: int = 15
    stands: tuple[float, float] = (0.3, 1.2)


WALKS, RUNS = WalkDraws(), RunDraws()
