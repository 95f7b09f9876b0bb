"""A light object of the scene as the core sees it."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.control.load import by_volume
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
