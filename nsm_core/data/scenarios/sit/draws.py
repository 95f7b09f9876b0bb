"""What is drawn at random for sits, and how."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.ik.thighs import ALONG_THIGH, EARLY, LAP, LATE, LEAN_ON_HANDS, OFF_THIGH, SEATED_LEAN


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
    # Paces: share, seconds of the way down and of that up, and speed of the way there, m/s.
    brisk: float = 0.3
    brisk_down: tuple[float, float] = (0.6, 0.8)
    brisk_up: tuple[float, float] = (0.55, 0.7)
    brisk_way: tuple[float, float] = (1.15, 1.4)
    slow: float = 0.25
    slow_down: tuple[float, float] = (1.1, 1.6)
    slow_up: tuple[float, float] = (1.0, 1.4)
    slow_way: tuple[float, float] = (0.8, 0.95)
    usual_down: tuple[float, float] = (0.8, 1.1)
    usual_up: tuple[float, float] = (0.7, 1.0)
    usual_way: tuple[float, float] = (0.95, 1.25)
    # Hands: share of the seats with arm rests on which they lie, where these are no lower or higher, metres
    # over the seat, than suits an arm; of the seats without that they lie on beside the hips; else on the
    # thighs, so far along from hip to knee, or, this share of those, in the lap.
    on_rests: float = 0.85
    rests_over_seat: tuple[float, float] = (0.16, 0.34)
    beside: float = 0.25
    beside_bench: float = 0.55  # the same where there is no back rest
    lap: float = LAP
    along_thigh: tuple[float, float] = ALONG_THIGH
    off_thigh: tuple[float, float] = OFF_THIGH  # metres to the inside of its middle
    beside_hips: tuple[float, float] = (0.23, 0.29)  # metres to the side, and
    ahead_of_hips: tuple[float, float] = (-0.08, 0.1)
    # Seatedness, 0 to 1, at which hands begin to come to where they lie, and arrive; leaning on one's hands
    # they come early and leave late.
    lean_on_hands: float = LEAN_ON_HANDS
    early: tuple[float, float] = EARLY
    late: tuple[float, float] = LATE
    swing: tuple[float, float] = (0.0, 0.2)  # metres that free arms swing ahead on the way
    # Lean of the trunk, radians ahead: seated, seated against a back rest (this share of the seats with one),
    # and more on the way down and up.
    seated_lean: tuple[float, float] = SEATED_LEAN
    against_back: float = 0.4
    back_lean: tuple[float, float] = (np.radians(-14), np.radians(-5))
    way_lean: tuple[float, float] = (0.0, np.radians(10))
    rests: tuple[float, float] = (0.6, 3.0)  # seconds on the seat
    rests_longer_at_table: float = 3.4
    turn: tuple[float, float] = (np.radians(75), np.radians(100))  # to a table, to either side
    turn_frames: tuple[int, int] = (34, 48)
    table_edge: tuple[float, float] = (0.24, 0.36)  # metres from the hips
    table_width: tuple[float, float] = (0.9, 1.6)
    table_depth: tuple[float, float] = (0.6, 0.8)
    rise_lead: tuple[int, int] = (3, 9)  # frames by which the command to rise precedes it
    stands: float = (
        0.4  # share that is asked to stand before the seat; the others are asked to go on while they rise
    )
    sets_off: tuple[float, float] = (
        0.0,
        0.7,
    )  # share of the last of the way up that is left out by who goes on
    stands_for: tuple[float, float] = (0.1, 1.0)


SITS = SitDraws()
