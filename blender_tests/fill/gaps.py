"""Walks with a gap: a take's motion keyed on any rig, some frames of it taken out again."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import bpy
import numpy as np

from nsm_blender.animation.channels import curves_in
from nsm_blender.fill.key_arrays import read_keys, taken, write_keys
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import key_take
from nsm_blender.prepare import TakeSpec
from nsm_blender.rigs.armature import Placement
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import finish, generate

START, END = 40, 66  # of the gap in ``hero``'s walk


@lru_cache(maxsize=1)
def walk() -> tuple[np.ndarray, np.ndarray]:
    """Hips (T, 3) and rotations (T, 23, 4) at 30 Hz of a walk of three metres."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    character = add_character((0.0, 0.0, 0.0))
    spec = TakeSpec(character, [GoalSpec("walk", None, 0.2, location=(0.0, -3.0, 0.0))])
    result = finish(generate(spec, bpy.context.scene)).result
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return result.hips_position, result.local_rotations


def walking(character: bpy.types.Object, fps: int) -> bpy.types.Action:
    """Key the walk on a character at a scene rate, as large as it is."""
    hips, local = walk()
    bpy.context.scene.render.fps = fps
    return key_take(character, hips * Placement.of(character).scale, local, 1).action


def cut(character: bpy.types.Object, start: float, end: float, but: tuple[str, ...] = ()) -> None:
    """Take all keys between two frames out of what a character plays, but those of the bones ``but``."""
    for curve in playing(character):
        if not any(f'"{name}"' in curve.data_path for name in but):
            keys = read_keys(curve)
            write_keys(curve, taken(keys, ~inside(keys, start, end)))


def playing(character: bpy.types.Object) -> list[bpy.types.FCurve]:
    """The curves that a character plays."""
    data = character.animation_data
    return list(curves_in(data.action, data.action_slot))


def inside(keys: dict[str, np.ndarray], start: float, end: float) -> np.ndarray:
    """Which keys lie between two frames."""
    frames = keys["co"][:, 0]
    return (frames > start + 1e-3) & (frames < end - 1e-3)


def outside(character: bpy.types.Object, start: float, end: float) -> dict[tuple[str, int], dict[str, Any]]:
    """All bytes of the keys outside a gap, and what kind of curve they are on."""
    found = {}
    for curve in playing(character):
        keys = read_keys(curve)
        kept = taken(keys, ~inside(keys, start, end))
        found[curve.data_path, curve.array_index] = {
            **{name: values.tobytes() for name, values in kept.items()},
            "extrapolation": curve.extrapolation,
            "group": curve.group and curve.group.name,
        }
    return found
