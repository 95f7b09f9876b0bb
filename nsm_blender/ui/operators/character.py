"""Add the bundled character."""

from __future__ import annotations

import bpy

from ..properties import settings_of
from .reporting import InObjectMode, telling


class NSM_OT_add_character(InObjectMode, bpy.types.Operator):
    bl_idname = "nsm.add_character"
    bl_label = "Add Character"
    bl_description = "Add the bundled character at the 3D cursor, facing -Y, and choose it"
    adds = "Characters are added"

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...animation.made import all_or_nothing
        from ...rigs.character import add_character

        with all_or_nothing():
            settings_of(context.scene).character = add_character(
                location=tuple(context.scene.cursor.location)
            )


CLASSES = (NSM_OT_add_character,)
