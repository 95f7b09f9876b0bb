"""A captured piece that is played as a whole, and where it lies in a database."""

from __future__ import annotations

from dataclasses import dataclass

from nsm_core.body.clip import Clip


@dataclass(frozen=True)
class Segment:
    """A captured piece that is played as a whole: a clip and frames in it by name."""

    clip: Clip
    marks: dict[str, int]

    def mirrored(self) -> Segment:
        """The piece reflected left to right."""
        return Segment(self.clip.mirrored(), self.marks)


@dataclass(frozen=True)
class LaidSegment:
    """A segment in a library: its ``first`` frame, one past its ``last``, and its marks, library indices."""

    first: int
    last: int
    marks: dict[str, int]
