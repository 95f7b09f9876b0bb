"""Who acts: the character's armature, or the bundled one."""

from __future__ import annotations

import bpy

from . import running
from .drawing import Sidebar
from .properties import settings_of


class NSM_PT_character(Sidebar, bpy.types.Panel):
    bl_label = "Character"
    bl_idname = "NSM_PT_character"
    bl_parent_id = "NSM_PT_motion"

    def draw(self, context: bpy.types.Context) -> None:
        settings = settings_of(context.scene)
        row = self.layout.row(align=True)
        choice = row.row(align=True)
        choice.enabled = running.current() is None
        choice.prop(settings, "character", text="", icon="ARMATURE_DATA", placeholder="Armature or its mesh")
        row.operator("nsm.add_character", text="", icon="ADD")
