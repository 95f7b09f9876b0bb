"""What is drawn at random for sits, and how."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SitDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw, spreads are standard
    deviations.

    Metres, seconds, radians and frames.
    """

    kinds: tuple[str, ...] = ("chair", "chair", "armchair", "stool", "bench", "sofa")
    # Share of the seats that stand partly under a table and are taken from the side; fewer of them work out.
    sideways: float = 0.2
    kinds_at_table: tuple[str, ...] = ("chair", "chair", "stool")
    tries: int = 6  # places and ways for one seat
    place: tuple[float, float] = (0.9, 4.5)  # metres from here to the seated hips
    wide: float = 0.65  # metres from where on a seat is wide:
    wide_from_the_front: float = (
        0.6  # ways to the ends of a wide seat lead over it; from the front there is room
    )
    off_the_front: float = 1.0  # to either side
    from_behind: float = 0.3  # share: the way is long and often fails
    off_the_back: float = 1.2
    # Metres ahead of where the captured hips come down that they are put.
    further_on: tuple[float, float] = (-0.06, 0.05)
    off_place: float = 0.01  # spread of the seat about where the hips are, each way
    down_rate: tuple[float, float] = (0.85, 1.25)  # how fast captured frames are played
    up_rate: tuple[float, float] = (0.85, 1.2)
    rests: tuple[float, float] = (0.6, 3.0)  # seconds on the seat
    rests_longer_at_table: float = 3.4
    turn: tuple[float, float] = (np.radians(75), np.radians(100))  # to a table, to either side
    turn_frames: tuple[int, int] = (34, 48)
    table_edge: tuple[float, float] = (0.24, 0.36)  # metres from the hips
    table_width: tuple[float, float] = (0.9, 1.6)
    table_depth: tuple[float, float] = (0.6, 0.8)
    rise_lead: tuple[int, int] = (3, 9)  # frames by which the command to rise precedes it
    stands: float = (
        0.5  # share that is asked to stand before the seat; the others are asked to go on while they rise
    )
    stands_for: tuple[float, float] = (0.2, 1.2)


SITS = SitDraws()
