"""What the network saw and foresaw in one frame of a take, kept small for whoever shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nsm_core.model.features.codec import Prediction
from nsm_core.rotations import Array
from nsm_core.world.sensors.environment import environment_points_world
from nsm_core.world.sensors.interaction import InteractionVolume

from .actions.base import Grasp


@dataclass(frozen=True)
class Insight:
    """One frame: what was sensed at ``root`` (3,), and the two views of the way that were predicted of it.

    ``level`` metres by which the walker's floor lies over that of the world; ``environment`` (1408,) and the
    ``volume``'s occupancy (512,) in 0..255, uint8, the volume None where nothing is sensed; ``egocentric``
    and ``goalward`` (7, 3) x, y and heading of the pivot and the six keys ahead, seen from the character and
    from its goal; ``goal`` (3,) where the last key is sent; ``doing`` what hands are at.  World frame, metres
    and radians.
    """

    root: Array
    level: float
    environment: Array
    volume: InteractionVolume | None
    egocentric: Array
    goalward: Array
    goal: Array
    doing: str = ""

    @classmethod
    def of(
        cls,
        root: Array,
        level: float,
        environment: Array,
        volume: InteractionVolume | None,
        goals: Array,
        doing: str,
    ) -> Insight:
        """What was sensed at ``root`` (3,), with the goals (13, 3) of the keys, before anything is
        predicted.
        """
        if volume is not None:
            volume = replace(volume, occupancy=_bytes(volume.occupancy))
        here = np.repeat(root[None], 7, axis=0)
        return cls(root.copy(), level, _bytes(environment), volume, here, here, goals[-1].copy(), doing)

    def foreseeing(self, predicted: Prediction) -> Insight:
        """The same with the ways that a batch of one was predicted to go."""
        return replace(
            self,
            egocentric=predicted.root[0].astype(np.float32),
            goalward=predicted.root_goalward[0].astype(np.float32),
        )

    def spheres_world(self) -> Array:
        """Centres (1408, 3) of the environment sensor's spheres, world metres."""
        centres = environment_points_world(self.root[:2], float(self.root[2]))
        centres[:, 2] += self.level
        return centres


def doing_of(grasps: Sequence[Grasp]) -> str:
    """What hands are at, in words: the part of their work, and the thing."""
    return ", ".join(f"{g.state} {g.prop.name}" for g in grasps if g.prop is not None)


def _bytes(values: Array) -> Array:
    return np.round(255 * np.clip(values, 0, 1)).astype(np.uint8)
