"""What is drawn at random for climbs, and how."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ClimbDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw, spreads are standard
    deviations.

    Metres, seconds, radians and frames; speeds in m/s.
    """

    walls: float = 0.25  # share of low walls; the others are steps
    low: float = 0.3  # metres of height under which a piece is low
    fewer_low: float = (
        0.4  # share of low pieces that are drawn again: what is high is harder to learn, and fits less often
    )
    place: tuple[float, float] = (1.5, 3.6)  # metres from here
    off_the_way: float = 0.6  # spread of the heading at the end about the way there
    straight_end: tuple[float, float] = (0.9, 1.5)
    speed: tuple[float, float] = (0.7, 1.2)
    off_square: float = 0.05  # spread of the piece's heading about the last steps
    from_sides: float = (
        0.3  # metres that the way keeps from the sides of the piece, anywhere else along its width
    )
    # Metres behind a low wall where one stands, as the feet allow.
    behind_wall: tuple[float, float] = (0.2, 0.95)
    # Where the edge lies between the feet: 0 at the one on the floor.
    into_stride: tuple[float, float] = (0.0, 0.5)
    slowness: tuple[float, float] = (0.9, 1.15)  # about how slowly a height is climbed
    stands: tuple[float, float] = (0.3, 2.0)  # seconds on top
    leaves: int = 6  # ways down that are tried
    led: float = 0.5  # share of them that are led along
    narrow: float = 0.35  # metres of half a top under which one leaves straight on
    off_ahead: tuple[float, float] = (0.35, 1.3)  # spread of the way down, on narrow tops and on others
    beyond: tuple[float, float] = (0.6, 1.8)  # metres beyond the edge
    off_the_way_down: float = 0.5
    stands_below: tuple[float, float] = (0.3, 1.2)


CLIMBS = ClimbDraws()
