"""What goals bring along: things that move, places that are led to, ground that is stepped onto."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import replace

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import Prop
from nsm_core.world.scene.stairs import Stairs
from nsm_core.world.scene.terrain import Terrain, around, merged

from .goals import Goal

_ROAMED = 200.0 * np.array(((-1.0, -1.0), (1.0, 1.0)))  # metres of floor about one who is steered


def own_props(goals: list[Goal]) -> tuple[list[Goal], dict[str, Prop]]:
    """Copies of goals whose props may be moved, and those props by name; what bears one name is one thing."""
    props: dict[str, Prop] = {}
    for goal in [one for asked in goals for one in asked.parts]:
        if goal.prop is not None and goal.prop.name not in props:
            props[goal.prop.name] = copy(goal.prop)
            props[goal.prop.name].pose = goal.prop.pose.copy()
    return [with_props(goal, props) for goal in goals], props


def with_props(goal: Goal, props: Mapping[str, Prop]) -> Goal:
    """The same goal about these props, by the names of its own."""
    first, then = (tuple(with_props(one, props) for one in some) for some in (goal.first, goal.then))
    return replace(goal, first=first, then=then, prop=None if goal.prop is None else props[goal.prop.name])


def places_of(goals: list[Goal], props: Iterable[Prop]) -> list[Array]:
    """Floor places (N, 2) that goals and their props lead to, in pieces."""
    ways = [g.way for g in goals if g.way is not None]
    ways += [g.position[:2] + _ROAMED for g in goals if g.steering is not None]
    return [*[g.position[None, :2] for g in goals], *[p.pose[None, :2] for p in props], *ways]


def ground_of(goals: list[Goal], environment: DistanceQuery, stairs: Stairs) -> Terrain:
    """The ground that climbs of these goals lead onto, as given or felt in the scene, but for what ``stairs``
    lead to.
    """
    climbs = [g for g in goals if BY_KEY[g.action].raises and not stairs.lead_to(g.position)]
    return merged(
        g.terrain or Terrain.probe(environment, g.interaction or around(g.position)) for g in climbs
    )
