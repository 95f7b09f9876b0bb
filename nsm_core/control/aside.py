"""What blocks a thing that is asked for is put aside before: goals that are done first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.affordances.clearing import plan_clearing
from nsm_core.world.affordances.picking import Around
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.planning.walked_to import room_walked_to
from nsm_core.world.scene.props import LightThing

from .goals import Goal


def with_aside(
    goal: Goal,
    thing: LightThing,
    others: Sequence[LightThing],
    solids: Callable[[Sequence[LightThing]], DistanceQuery],
    plan: FloorPlan,
    here: Array,
    refused: GoalError,
) -> Goal:
    """The goal of a ``thing`` that cannot be taken as it stands, with goals before it that put aside what
    blocks it, as few of ``others`` as can be.

    All stand where they do once everything is open.  ``solids`` tells what stands where some things are
    gone; one comes from ``here`` (2,).  Raises ``refused`` where that helps nothing.
    """
    end = goal.position.astype(np.float64)
    room = room_walked_to(plan, here, np.stack((thing.pose[:2], end[:2])))

    def without(gone: Sequence[LightThing]) -> Around:
        standing = solids(gone)
        return Around(standing, standing, room)

    found = plan_clearing(thing, end, others, without, refused)
    aside = tuple(
        Goal("place", one.name, picking.pose[:3], 0.0, 0.0, prop=one, picking=picking)
        for one, picking in found.aside
    )
    return replace(goal, first=(*goal.first, *aside), picking=found.picking)


__all__ = ["with_aside"]
