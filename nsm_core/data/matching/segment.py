"""A captured piece that is played as a whole, and where it lies in a database."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.rotations import Array


@dataclass(frozen=True)
class Segment:
    """A captured piece that is played as a whole: a clip and frames in it by name.

    ``goal`` (4,) is where its goal lies as seen from the hips amid it and their heading, x, y, z, metres, and
    heading, radians;
    None: right there.
    """

    clip: Clip
    marks: dict[str, int]
    goal: Array | None = None

    def mirrored(self) -> Segment:
        """The piece reflected left to right."""
        return Segment(
            self.clip.mirrored(),
            self.marks,
            None if self.goal is None else self.goal * np.array((-1, 1, 1, -1)),
        )


@dataclass(frozen=True)
class SitDown:
    """One captured sit-down and rise: stand at 0, seat reached at ``down``, left at ``up``, stand at the end.

    ``goal`` as a segment has it, and the frame at which rising is ``asked`` for, where a sidecar says them.
    """

    clip: Clip
    down: int
    up: int
    goal: Array | None = None
    asked: int | None = None


@dataclass(frozen=True)
class LaidSegment:
    """A segment in a library: its ``first`` frame, one past its ``last``, its marks, library indices, and its
    goal.
    """

    first: int
    last: int
    marks: dict[str, int]
    goal: Array | None = None
