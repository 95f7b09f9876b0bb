"""What is to be filled."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy

from nsm_core.errors import GapError

from ..goals.spec import GoalSpec

NETWORK, INTERPOLATE = "network", "interpolate"
METHODS = (NETWORK, INTERPOLATE)


@dataclass
class FillSpec:
    """A stretch of a character's animation whose missing frames are to be made.

    ``start`` and ``end`` are frames of the scene: the pose that is left and the pose that is reached, which
    both stay; without them the gap around ``at``, the scene's current frame where that is None.  Poses keyed
    in between are reached, too, and single keys are kept, unless ``replace``.  ``seed`` 0 is the likeliest
    motion, others are variations.  ``method`` is one of ``METHODS``.  ``bones`` are those that get keys, all
    of the body where that is None.
    """

    character: bpy.types.Object
    start: float | None = None
    end: float | None = None
    at: float | None = None
    seed: int = 0
    replace: bool = False
    method: str = NETWORK
    name: str = ""
    bones: frozenset[str] | None = None
    goals: list[GoalSpec] = field(default_factory=list, init=False)  # none: what watches takes asks for them

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise GapError(f'There is no method "{self.method}"; give "{NETWORK}" or "{INTERPOLATE}".')
        if (self.start is None) != (self.end is None):
            raise GapError("A gap has two ends; give the frames of both poses, or none of them.")
