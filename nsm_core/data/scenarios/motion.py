"""A performance while it is being fitted to its objects: what episodes read and change."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.conventions import CONTACTS, STYLES
from nsm_core.rotations import Array

from .landing import stay
from .take import Placed, Thing, TimedCommand


@dataclass
class Motion:
    """T frames laid end to end, in the world, seams softened.

    ``hips`` (T, 3), ``rotations`` (T, J, 4) local; ``roots`` (T, 2) and ``headings`` (T,) the smoothed root
    it was laid on; ``feet`` (T, 2) bool, right and left foot stand; ``contacts`` (T, 5) and ``labels`` (T, 7)
    as in ``Take`` (feet are copied into the contacts at the end); ``commands`` of the session, to be
    completed in place; ``things``, ``obstacles`` that belong to an episode (a wall about a door, a table
    under a box) and ``phase_keys`` to be added to.  ``level`` (T,) metres by which the floor that all is told
    over lies over that of the world: stairs raise it.
    """

    hips: Array
    rotations: Array
    roots: Array
    headings: Array
    feet: Array
    commands: list[TimedCommand]
    rng: np.random.Generator
    contacts: Array = field(init=False)
    labels: Array = field(init=False)
    things: list[Thing] = field(default_factory=list)
    obstacles: list[Placed] = field(default_factory=list)
    phase_keys: list[int] = field(default_factory=list)
    level: Array = field(init=False)

    def __post_init__(self) -> None:
        self.contacts = np.zeros((len(self), len(CONTACTS)), np.float32)
        self.labels = np.zeros((len(self), len(STYLES)), np.float32)
        self.level = np.zeros(len(self))

    def __len__(self) -> int:
        return len(self.hips)

    def land(self, start: int, settled: int, end: int) -> None:
        """Let both feet stand from ``start`` to ``end``: what stands already stays where that is near its
        place of frame ``settled``, or is set there by a step; see ``landing``.
        """
        stay(self, start, settled, end)

    def ramp(self, label: int, start: int, full: int, leaving: int, gone: int) -> None:
        """Raise a label from 0 at frame ``start`` to 1 at ``full``, hold it to ``leaving`` and lower it to 0
        at ``gone``.
        """
        values = np.interp(
            np.arange(len(self)), (start, full, leaving, max(gone, leaving + 1)), (0, 1, 1, 0)
        ).astype(np.float32)
        values[: max(start, 0)] = 0
        np.maximum(self.labels[:, label], values, out=self.labels[:, label])
