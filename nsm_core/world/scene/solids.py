"""Everything solid around a character: what stands still, and props where they are now."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery, Union

from .props import Prop


class Other(DistanceQuery, Protocol):
    """Something that is moved by nobody in this scene's take: another character, or what that one moves.

    ``pose`` (4,) x, y, z and heading; where it is ``settled``, ways lead around it.
    """

    @property
    def pose(self) -> Array:
        """Where it is now."""
        ...

    @property
    def settled(self) -> bool:
        """Whether it stays there for now."""
        ...

    @property
    def reach(self) -> float:
        """Metres on the floor from its place within which all of it lies."""
        ...


class Scene:
    """An environment that does not move, the props in it, and ``others`` who move by themselves."""

    def __init__(self, environment: DistanceQuery, props: Iterable[Prop] = ()) -> None:
        self.environment, self.props = environment, list(props)
        self.others: list[Other] = []

    def but(self, *left_out: Prop | None) -> DistanceQuery:
        """Everything but some props; follows the others as they move."""
        parts: list[DistanceQuery] = [p for p in self.props if all(p is not o for o in left_out)]
        parts += self.others
        return Union([self.environment, *parts]) if parts else self.environment

    def near(self, place: Array, reach: float, *left_out: Prop) -> DistanceQuery:
        """Everything but some props and those that are farther than ``reach`` metres from ``place`` (2,)."""
        parts: list[DistanceQuery] = [
            p for p in self.props if _gap(p, place) <= reach and all(p is not o for o in left_out)
        ]
        parts += [o for o in self.others if np.hypot(*(o.pose[:2] - place)) <= reach + o.reach]
        return Union([self.environment, *parts]) if parts else self.environment


def _gap(prop: Prop, place: Array) -> float:
    """At least so many metres (over the floor) lie between a prop and a place (2,)."""
    volume = prop.volume
    centre = prop.to_world(volume.centre)[:2]
    return float(np.linalg.norm(centre - np.asarray(place)[:2]) - np.linalg.norm(volume.size[:2]) / 2)
