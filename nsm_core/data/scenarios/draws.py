"""What is drawn at random for all that is composed, whatever the action: performances, ways, furnishing.

What an action draws stands in the ``draws`` of its folder; all of it is kept with data: ``registry.drawn``.
"""

from __future__ import annotations

from dataclasses import dataclass

from nsm_core.distances import WALKED


@dataclass(frozen=True)
class PerformanceDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw, spreads are standard
    deviations; of pairs of whole numbers the second is never drawn.

    Metres, seconds, radians and frames; speeds in m/s, decelerations in m/s2.
    """

    parts: tuple[int, int] = (2, 5)
    attempts: int = 4  # draws for each part that is wanted
    stands_first: tuple[float, float] = (0.3, 1.2)
    lead: tuple[int, int] = (2, 9)  # frames by which a command precedes its answer
    # captured pieces on their own
    sent: float = 0.5  # share of the walks to a stand that are asked for by their end, the others are led
    stands_last: tuple[float, float] = (0.8, 1.6)


@dataclass(frozen=True)
class WayDraws:
    """As ``PerformanceDraws``: the ways from here to a place."""

    speed: tuple[float, float] = WALKED
    turn_distance: tuple[float, float] = (0.35, 0.9)  # metres before the end in which one turns as is asked
    deceleration: tuple[float, float] = (0.7, 1.1)
    arrives: tuple[float, float] = (60.0, 130.0)  # degrees at most between the end of a way and what is faced
    around_seat: tuple[float, float] = (60.0, 110.0)  # the same of one that leads around a seat
    detours: float = 0.4  # share of ways longer than
    detour_from: float = 2.0
    detour_at: tuple[float, float] = (0.35, 0.65)  # share of the way at which it leads
    detour_by: tuple[float, float] = (0.5, 1.1)  # metres aside


@dataclass(frozen=True)
class FurnishingDraws:
    """As ``PerformanceDraws``: what stands beside a way that was walked."""

    kinds: tuple[str, ...] = (
        "table", "desk", "cabinet", "box", "chair", "armchair", "sofa", "wall", "stool", "table",
    )  # fmt: skip
    pieces: tuple[int, int] = (0, 26)  # that are tried
    off_way: tuple[float, float] = (0.5, 2.4)  # metres from the way to their middles
    way_room: float = 0.36  # metres that the way keeps from all of them
    in_detours: tuple[str, ...] = ("table", "box", "cabinet", "chair", "stool", "desk")
    tries_in_detour: int = 3
    off_detour: float = 0.12  # spread of their middles about that of the straight way
    holes: float = 0.3  # share of takes with a wall whose opening is walked through
    hole_room: float = 0.34  # metres that the way keeps from the opening's sides
    tries_of_hole: int = 6
    hole_aside: float = 0.06  # metres of the way off the opening's middle, each way
    hole_off_square: float = 0.15  # spread of the wall's heading about the way's


PERFORMANCES, WAYS, FURNISHINGS = PerformanceDraws(), WayDraws(), FurnishingDraws()
