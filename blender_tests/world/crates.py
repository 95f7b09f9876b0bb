"""Crates, and what of a scene is solid."""

from __future__ import annotations

import bpy
from colliders_now import collider_shapes
from scenes import box


def names():
    bpy.context.view_layer.update()
    return sorted(s.owner for s in collider_shapes(bpy.context.scene, bpy.context.evaluated_depsgraph_get()))


def crate(name, x=0.0):
    return box(name, (x, 0, 0), (x + 0.8, 0.8, 0.8))
