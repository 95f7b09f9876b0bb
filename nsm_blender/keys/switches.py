"""Properties of a rig that have its controls obey a take's keys: read, set and keyed."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..animation.channels import ActionChannels
from ..rigs.bone_map import bone_map_of


def switches_of(armature: bpy.types.Object) -> list[tuple[str, dict[str, float]]]:
    """Values of the properties that are keyed with a take, by bone."""
    bones = armature.pose.bones
    return [
        (name, {key: _switch(bones[name], key) for key in values if _has_switch(bones[name], key)})
        for name, values in bone_map_of(armature).switches.items()
    ]


def set_switches(bone: bpy.types.PoseBone, values: Mapping[str, float]) -> None:
    """Set properties that a bone has, its own or custom ones, each in the kind of number that it is."""
    for key, value in values.items():
        if key in bone:
            bone[key] = type(bone[key])(value)
        elif _has_switch(bone, key):
            setattr(bone, key, type(getattr(bone, key))(value))


def key_switches(channels: ActionChannels, armature: bpy.types.Object, frames: Array) -> None:
    """Key the properties that have a rig's controls obey these keys, by one key each."""
    for name, values in bone_map_of(armature).switches.items():
        for key, value in values.items():
            bone = armature.pose.bones[name]
            if _has_switch(bone, key):
                path = f'["{bpy.utils.escape_identifier(key)}"]' if key in bone else f".{key}"
                full = f'pose.bones["{bpy.utils.escape_identifier(name)}"]{path}'
                channels.curve(full, 0, name, frames[:1], np.array([value]))


def _has_switch(bone: bpy.types.PoseBone, key: str) -> bool:
    return key in bone or isinstance(getattr(bone, key, None), bool | int | float)


def _switch(bone: bpy.types.PoseBone, key: str) -> float:
    return bone[key] if key in bone else getattr(bone, key)
