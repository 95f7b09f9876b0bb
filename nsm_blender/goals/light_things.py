"""Light objects of the scene as the core sees them, also in a drawer that has been opened."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import bpy
import numpy as np

from nsm_core.control.load import by_volume
from nsm_core.errors import NsmError
from nsm_core.world.geometry.distance import Union
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing, sense

from ..world.surroundings import Surroundings


def read_thing(target: bpy.types.Object, around: Surroundings, mass: float | None) -> LightThing:
    """An object as a thing in one hand: its frame under the middle of its foot, upright."""
    body = around.body(target)
    low, high = body.bounds
    foot = np.append((low + high)[:2] / 2, low[2])
    pose = np.append(body.to_core(foot), body.yaw).astype(np.float64)
    query = body.solid_at(pose)
    size = high - low
    corners = np.append(-size[:2] / 2, 0.0), np.append(size[:2] / 2, size[2])
    weighs = by_volume(size) if mass is None else mass
    return LightThing(target.name, query, sense(query, *corners), pose, *corners, mass=weighs)


def riding(around: Surroundings) -> Iterator[tuple[bpy.types.Object, LightThing, LightThing]]:
    """What stands in fronts that goals move and has not been taken out by then: the object, and the thing as
    the scene has it, and where it is by then.
    """
    for target in (one for things in around.inside.values() for one in things):
        front, end = around.left[target]
        if not isinstance(front, Front):
            continue
        try:
            thing = read_thing(target, around, None)
        except NsmError:
            continue
        yield target, thing, thing.put(front.carried(thing.pose, replace(front, pose=end).opening))


def hold_what_stays(around: Surroundings) -> None:
    """Have fronts be as solid as what stands in them to the end of a take, once all its goals are found."""
    held: dict[str, tuple[Front, list[LightThing]]] = {}
    for target, thing, _ in riding(around):
        front = around.left[target][0]
        assert isinstance(front, Front)
        own = np.append(front.to_local(thing.pose[:3]), thing.pose[3] - front.pose[3])
        held.setdefault(front.name, (front, []))[1].append(thing.put(own))
    for front, things in held.values():
        front.query = Union([front.query, *things])
