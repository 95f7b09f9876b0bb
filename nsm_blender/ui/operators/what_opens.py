"""Show what opens of furniture, as points to edit."""

from __future__ import annotations

import bpy

from .reporting import InObjectMode, telling


class NSM_OT_what_opens(InObjectMode, bpy.types.Operator):
    bl_idname = "nsm.what_opens"
    bl_label = "Show What Opens"
    bl_description = (
        "Propose the doors, drawers and lids of the selected furniture, whose front is its -Y: an empty on "
        "each axis, whose Z it is, and one at each handle. Move and turn them where they are wrong"
    )
    adds = "Points are added"

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        if not any(o.type == "MESH" for o in context.selected_objects):
            return "Select a piece of furniture, or all its parts."
        return super().reason_not(context)

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...animation.made import all_or_nothing
        from ...goals.container_points import show_what_opens

        with all_or_nothing():
            added, proposals = show_what_opens(context.scene, list(context.selected_objects))
        told = ", ".join(f"{p.part.name} ({p.part.kind})" for p in proposals)
        self.report({"INFO"}, f"{len(added)} points added; what opens: {told}.")


CLASSES = (NSM_OT_what_opens,)
