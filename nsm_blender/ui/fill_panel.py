"""Fill: missing frames between keys that stand."""

from __future__ import annotations

import bpy

from .drawing import Sidebar, sentence, settings_column
from .operators.fill import character_of, filled_before, has_strips, reason_not
from .properties import settings_of


class NSM_PT_fill(Sidebar, bpy.types.Panel):
    bl_label = "Fill"
    bl_idname = "NSM_PT_fill"
    bl_parent_id = "NSM_PT_motion"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, options = self.layout, settings_of(context.scene).fill
        column = settings_column(layout)
        column.prop(options, "where")
        if options.where == "SEAM":
            column.prop(options, "seam")
        column.prop(options, "method")
        column.prop(options, "seed")
        column.prop(options, "replace")
        big = layout.column()
        big.scale_y = 1.5
        big.operator("nsm.fill", icon="KEYFRAME").where = "PANEL"
        if filled_before(context) is not None:
            layout.operator("nsm.another_fill", icon="FILE_REFRESH")
        row = layout.row(align=True)
        row.operator("nsm.thin_out", icon="KEY_DEHLT")
        row.operator("nsm.decompress", icon="KEY_HLT")
        character = character_of(context)
        if character is not None and has_strips(character):
            layout.operator("nsm.merge_strips", icon="NLA")
        reason = reason_not(context)
        if reason:
            sentence(context, layout, reason, "INFO")
