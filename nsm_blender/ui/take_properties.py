"""What a scene keeps of the takes that were made: their actions, and what was there before."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)


class NsmResult(bpy.types.PropertyGroup):
    """One line about the last take."""

    text: StringProperty()
    good: BoolProperty(default=True)


class NsmKeyed(bpy.types.PropertyGroup):
    """An action that a take made for one object, and what the object had before."""

    object: PointerProperty(type=bpy.types.Object)
    action: PointerProperty(type=bpy.types.Action)
    slot: IntProperty()
    previous_action: PointerProperty(type=bpy.types.Action)
    previous_slot: IntProperty()
    previous_fake_user: BoolProperty()
    previous_values: StringProperty(description="Pose or transform before the take, JSON")


class NsmTake(bpy.types.PropertyGroup):
    """A take of the list; kept in the scene, so that it is saved and undone with it.

    ``group`` is the same number for the takes of several characters that were made together, 0 for others.
    """

    character: PointerProperty(type=NsmKeyed)
    things: CollectionProperty(type=NsmKeyed)
    frame_start: IntProperty()
    frame_end: IntProperty()
    fps: FloatProperty()
    keys: StringProperty(description="Checksum of the keys as they were made")
    seed: IntProperty()
    accepted: BoolProperty()
    group: IntProperty()
