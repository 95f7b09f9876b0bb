"""What is drawn at random for doors, and how."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class OpenDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw, spreads are standard
    deviations.

    Metres, seconds, radians and frames; speeds in m/s.
    """

    place: tuple[float, float] = (0.5, 4.0)  # metres from here to where one takes the handle
    off_the_way: float = 1.3  # of the heading there about the way, to either side
    pauses: float = 0.7  # share that stands before it reaches for the handle
    pauses_for: tuple[float, float] = (0.05, 0.4)
    reach_before: tuple[int, int] = (0, 6)  # frames before one stands from which on the hand reaches
    reaches_for: tuple[float, float] = (0.4, 0.6)
    grip_frames: tuple[int, int] = (2, 5)  # from the grip to the press, and
    press_frames: tuple[int, int] = (1, 3)  # from the press to the first step
    pushes: float = 0.55  # share of doors that swing away
    # Seconds for which one stands back once a leaf is pulled open.
    waits_back: tuple[float, float] = (0.3, 0.9)
    further_back: tuple[float, float] = (-0.04, 0.08)  # beyond PULL_BACK
    back_speed: tuple[float, float] = (0.45, 0.75)
    through_speed: tuple[float, float] = (0.6, 0.9)
    slowed: tuple[float, float] = (0.65, 0.9)  # how fast the captured walk through is played
    stands_beyond: tuple[float, float] = (0.3, 1.2)
    led_on: float = 0.4  # share of passages that do not end standing
    led_on_after: tuple[int, int] = (5, 25)  # frames after the leaf is passed
    doors: int = 18  # that are tried about one walk
    # Of the same size, lest low handles and narrow doors, which fit fewer walks, get rare.
    insists: int = 12
    width: tuple[float, float] = (0.75, 1.0)
    # Lower ones of meshes are raised to the least, where one reaches them upright.
    handle_height: tuple[float, float] = (0.9, 1.1)
    wall: tuple[float, float] = (0.8, 1.6)  # on either side
    off_square: float = 0.03  # spread of the door's heading about the body's
    off_place: float = 0.025  # spread of the body about where one stands to take the handle, each way
    let_go_pushed: tuple[float, float] = (54.0, 70.0)  # degrees of the leaf at which a hand lets go
    let_go_pulled: tuple[float, float] = (56.0, 72.0)
    comes_to_rest: tuple[float, float] = (85.0, 100.0)


OPENS = OpenDraws()
