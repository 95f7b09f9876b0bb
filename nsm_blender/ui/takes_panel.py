"""What was made: the take that waits for a word, and what the last one has reached."""

from __future__ import annotations

import bpy

from .drawing import Sidebar, sentence
from .properties import settings_of
from .reviews import pending


class NSM_PT_takes(Sidebar, bpy.types.Panel):
    bl_label = "Takes"
    bl_idname = "NSM_PT_takes"
    bl_parent_id = "NSM_PT_motion"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, settings_of(context.scene)
        if pending(context.scene) is not None:
            row = layout.row(align=True)
            row.operator("nsm.take_accept", icon="CHECKMARK")
            row.operator("nsm.take_reject", icon="X")
            layout.operator("nsm.fit_scene", icon="PREVIEW_RANGE")
        elif not len(settings.results):
            sentence(context, layout, "No take waits here; press Generate.", "INFO")
        if len(settings.results):
            box = layout.box()
            for line in settings.results:
                sentence(context, box, line.text, "CHECKMARK" if line.good else "ERROR")
