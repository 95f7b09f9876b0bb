"""What is drawn at random while captured frames are laid one after the other."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MatchingDraws:
    """Pairs are the ends of an even draw."""

    cost: tuple[float, float] = (
        1.0,
        1.15,
    )  # factor of the costs, so that one course is walked in several ways
    sway_period: tuple[float, float] = (2.5, 4.5)  # seconds of the sway about a frame that is held


MATCHING = MatchingDraws()
