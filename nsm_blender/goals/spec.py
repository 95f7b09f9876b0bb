"""What is asked of an object: an action, and how long to stay."""

from __future__ import annotations

from dataclasses import dataclass

import bpy


@dataclass
class GoalSpec:
    """A goal as asked for: an object or a place (3,), world, an action and a hold in seconds; ``to`` where a
    box is carried.

    Of walk and run: ``along`` tells that the object is a curve to go along, ``rounds`` times where it is
    closed; ``speed`` m/s of the character, drawn where None.  ``by``: the frame at which it is to be
    reached, as soon as it can be where None.  ``mass`` kilograms of what is carried, by its size where None.
    ``close_after``: what a hand opens to get at a thing is shut again once that is put down.
    """

    action: str
    object: bpy.types.Object | None = None
    hold: float = 2.0
    location: tuple[float, float, float] | None = None
    to: bpy.types.Object | None = None
    along: bool = False
    rounds: int = 1
    speed: float | None = None
    by: float | None = None
    mass: float | None = None
    close_after: bool = True

    @property
    def label(self) -> str:
        """Name of the goal in lists, reports and messages."""
        return self.object.name if self.object else "place" if self.location is not None else "here"
