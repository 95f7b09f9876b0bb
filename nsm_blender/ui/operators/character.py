"""Add the bundled character."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ..properties import settings_of
from .reporting import sentences, while_idle


class NSM_OT_add_character(bpy.types.Operator):
    bl_idname = "nsm.add_character"
    bl_label = "Add Character"
    bl_description = "Add the bundled character at the 3D cursor, facing -Y, and choose it"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not while_idle(cls):
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Characters are added in Object Mode; leave the present mode with Tab.")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ...rigs.character import add_character

        with sentences(self):
            settings_of(context.scene).character = add_character(
                location=tuple(context.scene.cursor.location)
            )
            return {"FINISHED"}
        return {"CANCELLED"}


CLASSES = (NSM_OT_add_character,)
