"""One carry in the making: where the box rests, and how its parts are fitted and checked."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.session import Session
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.scene.furniture import Furniture
from nsm_core.world.scene.props import Box

from . import fit as carry_fit
from .pick_up import Bend
from .supports import Support


@dataclass
class Spot:
    """Where a box rests: its centre (3,) and heading of its carrier there, the bend that goes to it and what
    is under it.
    """

    centre: Array
    facing: float
    bend: Bend
    support: Support | None = None
    position: Array = field(default_factory=lambda: np.zeros(2))
    heading: float = 0.0


@dataclass
class CarryEpisode:
    """One carry: the box and its faces, where it is taken up and put down, and the commands that ask
    for it.
    """

    box: Box
    piece: Furniture  # the box's shape about its centre
    face: float  # heading of the carrier in the box's frame
    taken: Spot
    put: Spot
    fetch: int
    bring: list[int]
    places: list[tuple[Array, float]] = field(default_factory=list)
    thing: int = -1  # its number among the take's things

    def clear(self, session: Session) -> bool:
        """Whether nobody walks through the box where it rests or through what is under it."""
        roots = np.array(session.tape.roots)
        n = np.arange(len(roots))
        for spot, resting in ((self.taken, n < self.taken.bend.start), (self.put, n >= self.put.bend.end)):
            bent = (n >= spot.bend.start) & (n < spot.bend.end)
            close = (n > spot.bend.start - 45) & (n < spot.bend.end + 45)
            margin = np.where(close, 0.165, 0.22)
            half = np.array(self.box.across(self.face)) / 2
            if (_inside(roots, spot.centre[:2], spot.facing, -half, half, margin) & resting & ~bent).any():
                return False
            if spot.support is not None:
                lo, hi = spot.support.footprint
                if (_inside(roots, spot.position, spot.heading, lo, hi, margin) & ~bent).any():
                    return False
        return True

    def fit(self, motion: Motion) -> None:
        """Label the carry, let the feet stand while bending, put supports under the box and complete the
        commands.
        """
        carry_fit.label(self, motion)

    def finish(self, motion: Motion) -> None:
        """Move the box and lead the hands to it, with it and off it."""
        carry_fit.fit_hands(self, motion)


def _inside(points: Array, position: Array, heading: float, low: Array, high: Array, margin: Array) -> Array:
    local = rotate_planar(points - position, np.full(len(points), -heading))
    return ((local > low - margin[:, None]) & (local < high + margin[:, None])).all(axis=1)
