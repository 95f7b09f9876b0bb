"""Furniture that holds things: what stands, what of it opens, and the boards on which things are put."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.furniture import Furniture, cuboids
from nsm_core.world.scene.props import Prop

from .moving_part import MovingPart

# Metres: looked along the way out of a place for what shuts it, and between the samples; parts are thicker.
_WAY_OUT, _STEP, _MEETS = 0.8, 0.01, 0.004


@dataclass(frozen=True)
class Shelf:
    """A level rectangle to put things on, in the frame of its container.

    ``low``, ``high`` (2,) corners and ``height``, metres; ``room`` metres free above it; ``out`` (3,) the
    unit way by which things leave; ``rides`` the name of the drawer that it is the floor of, or "".
    """

    low: Array
    high: Array
    height: float
    room: float
    out: Array = field(default_factory=lambda: np.array((0.0, -1.0, 0.0)))
    rides: str = ""

    @property
    def size(self) -> Array:
        """Width and depth (2,), metres."""
        return self.high - self.low


@dataclass
class Container:
    """``piece`` what stands, ``parts`` what opens and ``boards``, all in one frame; ``pose`` (4,) places that
    frame, and ``put`` moves it.
    """

    name: str
    kind: str
    piece: Furniture
    parts: list[MovingPart] = field(default_factory=list)
    boards: list[Shelf] = field(default_factory=list)
    pose: Array = field(default_factory=lambda: np.zeros(4))

    def put(self, pose: ArrayLike) -> Container:
        """Place it and its parts at ``pose`` (4,): x, y, z (metres) and heading; returns itself."""
        self.pose = np.array(pose, dtype=np.float64)
        for part in self.parts:
            part.pose = self.pose.copy()
        return self

    def part(self, name: str) -> MovingPart:
        """A part by its name; GeometryError where it has none of that name."""
        for part in self.parts:
            if part.name == name:
                return part
        known = ", ".join(p.name for p in self.parts) or "nothing"
        raise GeometryError(f"{self.name} has no {name} to open; it has {known}.")

    def standing(self) -> Cuboids:
        """What stands of it, where it is."""
        return cuboids([(self.piece, self.pose[:3], float(self.pose[3]))])

    def to_world(self, points: ArrayLike) -> Array:
        """Points (..., 3) of its frame in the world."""
        points = np.asarray(points, dtype=np.float64)
        return rotate_planar(points, np.float64(self.pose[3])) + self.pose[:3]

    def shut_by(self, board: Shelf, place: ArrayLike) -> list[str]:
        """Names of the parts that must open before a hand gets to a ``place`` (3,), its frame, on a board:
        the drawer that it lies in, or what a ray along the way out meets (section 6.3).
        """
        if board.rides:
            return [board.rides]
        steps = np.arange(0.0, _WAY_OUT, _STEP)[:, None]
        ray = np.asarray(place, dtype=np.float64) + steps * board.out
        return [p.name for p in self.parts if _meets(p, ray)]


def _meets(part: MovingPart, ray: Array) -> bool:
    """Whether a ray (N, 3) in a part's frame meets it as it is open now."""
    world = Prop.to_world(part, ray)
    return bool((part.signed_distance(world, 0.1) < _MEETS).any())
