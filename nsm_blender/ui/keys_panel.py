"""How a take is keyed: its root motion, and whether fewer keys do."""

from __future__ import annotations

import bpy

from .drawing import Sidebar, settings_column
from .properties import settings_of


class NSM_PT_keys(Sidebar, bpy.types.Panel):
    bl_label = "Keys"
    bl_idname = "NSM_PT_keys"
    bl_parent_id = "NSM_PT_generate"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, options = self.layout, settings_of(context.scene).keys
        column = settings_column(layout)
        column.prop(options, "root_motion")
        column.prop(options, "keep_edits")
        column.prop(options, "reduce")
        if options.reduce:
            column.prop(options, "reduce_mm")
            column.prop(options, "reduce_degrees")
