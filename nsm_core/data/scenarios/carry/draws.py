"""What is drawn at random for carries, and how; sides of boxes: ``distances.CRATE_SIDE``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CarryDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw, spreads are standard
    deviations.

    Metres, seconds, radians and frames; speeds in m/s.
    """

    floor: float = 0.42  # share of places on the floor; the others are on
    supports: tuple[str, ...] = ("table", "table", "desk", "crate", "crate", "box")
    top: tuple[float, float] = (0.1, 1.0)  # height of a crate
    wider: tuple[float, float] = (0.0, 0.5)  # by which it is wider than the box, and
    deeper: tuple[float, float] = (0.02, 0.4)
    off_middle: float = 0.15  # spread of the box along the edge
    over_edge: float = 0.05  # by which boxes stand out over it at most, and
    inside_edge: float = 0.03  # by which they stand off it at most
    fetch: tuple[float, float] = (0.5, 4.6)  # metres from here to where one lifts the box
    fetch_speed: tuple[float, float] = (0.8, 1.35)
    led_first: float = 3.4  # metres from which on one is led at first, and
    fetch_asked: tuple[float, float] = (1.2, 3.2)  # metres from the box at which it is then asked for
    any_heading: float = 0.35  # share of ends that face anywhere; the others face the way there, give or take
    off_the_way: float = 0.8  # that spread
    straight: float = 0.5  # share of ways whose end is straight, for so long:
    straight_end: tuple[float, float] = (0.15, 0.6)
    off_square: float = 0.03  # spread of the box's heading about the body's
    aside: float = 0.012  # spread of the box to the sides of who lifts it
    nearer: tuple[float, float] = (-0.015, 0.03)  # beyond BODY_TO_BOX
    choice: float = 0.12  # mean cost by chance of a captured bend, lest it is always the same
    down_rate: tuple[float, float] = (0.72, 1.15)  # how fast captured frames are played
    up_rate: tuple[float, float] = (0.75, 1.15)
    least_bend: tuple[float, float] = (0.55, 0.8)  # seconds of a way down or up at least
    grasp_frames: tuple[int, int] = (4, 10)  # down there
    put_back: float = 0.12  # share that is only lifted and put back
    held_for: tuple[float, float] = (0.8, 3.0)  # seconds until then
    answer: tuple[int, int] = (2, 7)  # frames from a grasp or a release to the next command
    speed: tuple[float, float] = (0.7, 1.25)
    bring: tuple[float, float] = (0.5, 5.0)  # metres from the box to its place
    bring_led: float = 2.2  # metres from which on one is led at first, and
    bring_asked: tuple[float, float] = (1.5, 2.2)  # metres from the end at which the place is then asked for
    redirected: float = 0.2  # share that is sent elsewhere on the way, of ways so long:
    first_way: tuple[float, float] = (1.6, 4.0)
    pauses: float = 0.3  # share that stands before it puts the box down
    pauses_for: tuple[float, float] = (0.1, 0.4)
    stands: float = 0.4  # share that is asked to stand at the end; the others are asked to go on
    stands_for: tuple[float, float] = (0.1, 0.8)


CARRIES = CarryDraws()
