"""What was made: the take that waits for a word, what the last one has reached, and the list of all."""

from __future__ import annotations

from typing import Any

import bpy

from . import running
from .drawing import Sidebar, sentence
from .ghosts import ghosts_of
from .properties import settings_of
from .reviews import is_pushed, is_shown, pending, takes_of


class NSM_UL_takes(bpy.types.UIList):
    """One take a row: whether it is shown, its name, seed and frames, and whether it is accepted."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: Any,
        _data: Any,
        item: Any,
        _icon: int,
        _active: Any,
        _property: str,
        index: int = 0,
    ) -> None:
        row = layout.row(align=True)
        shown = is_shown(item)
        row.operator(
            "nsm.take_show", text="", icon="RADIOBUT_ON" if shown else "RADIOBUT_OFF", emboss=False
        ).index = index
        row.prop(item.character.action, "name", text="", emboss=False)
        facts = row.row(align=True)
        facts.alignment, facts.active = "RIGHT", shown
        facts.label(text=f"{item.seed}  {item.frame_start}\u2013{item.frame_end}")
        if is_pushed(item):
            facts.label(text="", icon="NLA")
        facts.label(text="", icon="CHECKMARK" if item.accepted else "BLANK1")

    def filter_items(
        self, context: bpy.types.Context, data: Any, _property: str
    ) -> tuple[list[int], list[int]]:
        here = takes_of(context.scene)
        return [self.bitflag_filter_item if take in here else 0 for take in data.takes], []


class NSM_PT_takes(Sidebar, bpy.types.Panel):
    bl_label = "Takes"
    bl_idname = "NSM_PT_takes"
    bl_parent_id = "NSM_PT_motion"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, settings_of(context.scene)
        listed = takes_of(context.scene)
        if pending(context.scene) is not None:
            row = layout.row(align=True)
            row.operator("nsm.take_accept", icon="CHECKMARK")
            row.operator("nsm.take_reject", icon="X")
            layout.operator("nsm.fit_scene", icon="PREVIEW_RANGE")
        elif not len(settings.results) and not listed:
            sentence(context, layout, "No take waits here; press Generate.", "INFO")
        if len(settings.results):
            box = layout.box()
            for line in settings.results:
                sentence(context, box, line.text, "CHECKMARK" if line.good else "ERROR")
        if ghosts_of(context.scene):
            box = layout.box()
            sentence(context, box, "Click the variation that you like, in the viewport or the list.", "INFO")
            row = box.row(align=True)
            row.operator("nsm.variation_pick", icon="CHECKMARK").remove_others = False
            row.operator("nsm.variation_pick", text="Pick, Remove Others", icon="TRASH").remove_others = True
            box.operator("nsm.ghosts_remove", icon="X")
        if listed:
            _draw_list(layout, settings)
        row = layout.row(align=True)
        row.operator("nsm.export_bvh", icon="EXPORT")
        row.operator("nsm.export_glb", icon="EXPORT")


def _draw_list(layout: Any, settings: Any) -> None:
    """The takes of the character, and what can be done with the marked one."""
    body = layout.column()
    body.enabled = running.current() is None
    row = body.row()
    row.template_list("NSM_UL_takes", "", settings, "takes", settings, "active_take", rows=3)
    side = row.column(align=True)
    side.operator("nsm.take_keep", text="", icon="CHECKMARK")
    side.operator("nsm.take_remove", text="", icon="X")
    side.separator()
    side.operator("nsm.takes_clear", text="", icon="TRASH")
    if settings.active_take < len(settings.takes):
        row = body.row(align=True)
        pushed = is_pushed(settings.takes[settings.active_take])
        row.operator("nsm.take_pull" if pushed else "nsm.take_push", icon="NLA")
        row.operator("nsm.take_range", icon="PREVIEW_RANGE")
