"""What is drawn over the scene, a toggle each."""

from __future__ import annotations

import bpy

from ..overlays.layers import LAYERS
from . import overlays
from .drawing import Sidebar, sentence


class NSM_PT_overlays(Sidebar, bpy.types.Panel):
    bl_label = "Overlays"
    bl_idname = "NSM_PT_overlays"
    bl_parent_id = "NSM_PT_motion"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, shown = self.layout, overlays.toggles()
        for title, ahead in (("Before a take", True), ("In a take", False)):
            column = layout.column(align=True)
            column.label(text=title)
            for layer in LAYERS:
                if (layer.before is not None) == ahead:
                    column.prop(shown, layer.key, icon=layer.icon, toggle=True)
        reason = overlays.reason_empty(context.scene)
        if reason:
            sentence(context, layout, reason, "INFO")
