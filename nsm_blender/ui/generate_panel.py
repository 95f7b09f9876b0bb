"""How the take is made: where it begins, which variation, and the button."""

from __future__ import annotations

import bpy

from nsm_core.world.actions import BY_KEY

from . import running
from .drawing import Sidebar, sentence, settings_column
from .properties import settings_of
from .queue import cast_of, queue_of
from .reviews import takes_of


class NSM_PT_generate(Sidebar, bpy.types.Panel):
    bl_label = "Generate"
    bl_idname = "NSM_PT_generate"
    bl_parent_id = "NSM_PT_motion"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, settings_of(context.scene)
        column = settings_column(layout)
        column.prop(settings, "start_frame")
        column.prop(settings, "begin")
        column.prop(settings, "seed")
        plain = layout.column()
        plain.enabled = running.current() is None
        plain.prop(settings, "contact_ik")
        asked = (BY_KEY.get(row.action) for row in queue_of(context.scene).goals if row.enabled)
        if sum(action is not None and action.pairs for action in asked) > 1:
            plain.prop(settings, "in_order")
        big = layout.column()
        big.scale_y = 1.5
        big.operator("nsm.generate", icon="PLAY")
        if len(cast_of(context.scene)) > 1:
            layout.operator("nsm.generate_all", icon="COMMUNITY")
        if takes_of(context.scene):
            layout.operator("nsm.another_take", icon="FILE_REFRESH")
        layout.operator("nsm.continue_take", icon="FRAME_NEXT")
        layout.operator("nsm.steer", icon="EVENT_W")
        row = layout.row(align=True)
        row.operator("nsm.variations", icon="OUTLINER_OB_ARMATURE")
        row.prop(settings.keys, "variations", text="")
        reason = running.reason_not_ready(context)
        if reason:
            sentence(context, layout, reason, "INFO")
