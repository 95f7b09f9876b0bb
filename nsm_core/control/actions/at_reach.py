"""A stage whose hands work from where one stands: going there, and telling when one stands there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import SIT
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, wrap_angle
from nsm_core.world.affordances.picking import Around
from nsm_core.world.affordances.reach import Reach
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.planning.walked_to import room_walked_to
from nsm_core.world.scene.props import Prop

from .approach import WALKING, Approach, Command, Gait, Ground
from .base import Stage

# Metres, radians and m/s within which one has come to stand where a hand works, and m/s that are stopped
# there; frames of standing still after which further off does, and how much.
NEAR, FACING, SLOW, DRIFTS = 0.1, np.radians(14), 0.12, 0.25
PATIENCE, ALSO_NEAR, ALSO_FACING = 25, 0.3, np.radians(40)
_Found = TypeVar("_Found")


class AtReach(Stage):
    """A stage that walks to where hands work, as often as it is sent."""

    approach: Approach
    reach: Reach
    held: Sequence[Prop]

    def __init__(self, goal: Goal, ground: Ground) -> None:
        super().__init__(goal)
        self.ground = ground

    def go(self, reach: Reach, gait: Gait = WALKING, held: Sequence[Prop] = ()) -> None:
        """Go to the place of a ``reach``; ``held`` is what is in hands."""
        self.reach, self.held, self._still = reach, held, 0
        final = Command("idle", np.append(reach.place, 0.0).astype(np.float32), reach.heading)
        # The network, which knows boxes alone, would raise both arms about what it sensed in the hand.
        self.approach = Approach(
            self.ground, reach.place, reach.heading, final, gait=gait, anyway=True, held=held
        )

    def keeps_off(self) -> tuple[FloorPlan, Array] | None:
        floor = self.ground.floor(*self.held)
        return None if floor is None else (floor, self.reach.place)

    def there(self, moment: Moment) -> bool:
        """Whether one stands where the hand works, or near it and comes no nearer."""
        if moment.speed > DRIFTS or float(moment.style[SIT]) > 0.1:
            self._still = 0
            return False
        self._still += moment.speed < SLOW
        off = float(np.linalg.norm(moment.root[:2] - self.reach.place))
        turned = abs(float(wrap_angle(moment.heading - self.reach.heading)))
        if off < NEAR and turned < FACING:
            return True
        return self._still > PATIENCE and off < ALSO_NEAR and turned < ALSO_FACING


def where_led(
    find: Callable[[Around], _Found],
    solids: DistanceQuery,
    plan: FloorPlan | None,
    here: Array,
    about: Sequence[Array],
) -> _Found:
    """What is found among ``solids`` by who stands only where one can walk to from ``here`` (2,), over the
    floor around places ``about`` (2,); GoalError as ``find`` raises it.
    """

    def room(places: Array) -> Array:
        return np.full(len(places), np.inf) if plan is None else np.asarray(plan.clearance(places))

    around = Around(solids, solids, room)
    if plan is not None:
        try:
            return find(replace(around, room=room_walked_to(plan, here, np.stack(about))))
        except GoalError:
            pass  # a place that cannot be walked to is found all the same: then it is the way that is missing
    return find(around)


__all__ = ["AtReach", "where_led"]
