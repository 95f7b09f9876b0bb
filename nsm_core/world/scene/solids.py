"""Everything solid around a character: what stands still, and props where they are now."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery, Union

from .props import Prop


class Scene:
    """An environment that does not move, and the props in it."""

    def __init__(self, environment: DistanceQuery, props: Iterable[Prop] = ()) -> None:
        self.environment, self.props = environment, list(props)

    def but(self, *left_out: Prop | None) -> DistanceQuery:
        """Everything but some props; follows the others as they move."""
        parts = [p for p in self.props if all(p is not o for o in left_out)]
        return Union([self.environment, *parts]) if parts else self.environment

    def near(self, place: Array, reach: float) -> DistanceQuery:
        """Everything but props that are farther than ``reach`` metres from ``place`` (2,)."""
        return self.but(*(p for p in self.props if _gap(p, place) > reach))


def _gap(prop: Prop, place: Array) -> float:
    """At least so many metres (over the floor) lie between a prop and a place (2,)."""
    volume = prop.volume
    centre = prop.to_world(volume.centre)[:2]
    return float(np.linalg.norm(centre - np.asarray(place)[:2]) - np.linalg.norm(volume.size[:2]) / 2)
