"""The place on the floor, or on what one can stand on, that a ray into the scene points at."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np
from mathutils import Vector

_UPRIGHT = 0.5  # up part of a surface's normal from which one may stand on it
_OFF = 0.35  # metres off a side at which a place before it lies
_ONWARD, _MOST = 1e-3, 50  # metres past a thing that is looked through, and how many of those


def picked_place(
    scene: bpy.types.Scene,
    origin: Vector,
    direction: Vector,
    floor: float = 0.0,
    metre: float = 1.0,
    through: Collection[bpy.types.Object] = (),
) -> Vector | None:
    """The place (3,), world, that a ray points at; None where it meets nothing and never comes to the floor.

    What is steep, as a wall or the side of a table, stands for the floor before it.  ``floor`` is the height
    where no object is hit, ``metre`` the length of one in Blender units; objects ``through`` are looked
    through, and so is what is no surface.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    direction = direction.normalized()
    found = _hit(scene, depsgraph, origin, direction, through, metre)
    if found is None:
        if direction.z > -1e-6 or origin.z <= floor:
            return None
        return origin + direction * ((floor - origin.z) / direction.z)
    place, normal = found
    if normal.dot(direction) > 0:
        normal = -normal
    if normal.z >= _UPRIGHT:
        return place
    before = place + normal * _OFF * metre
    below = _hit(scene, depsgraph, before, Vector((0, 0, -1)), through, metre)
    return (
        below[0] if below is not None and below[0].z >= floor - _OFF * metre else Vector((*before.xy, floor))
    )


def _hit(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    origin: Vector,
    direction: Vector,
    through: Collection[bpy.types.Object],
    metre: float,
) -> tuple[Vector, Vector] | None:
    """Where a ray first meets a surface, and its normal there."""
    for _ in range(_MOST):
        met, place, normal, _face, target, _matrix = scene.ray_cast(depsgraph, origin, direction)
        if not met:
            return None
        if target.original not in through and np.isfinite(place).all():
            return place.copy(), normal.copy()
        origin = place + direction * _ONWARD * metre
    return None
