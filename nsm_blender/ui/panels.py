"""The NSM tab in the sidebar of the 3D viewport; it shows what others have computed."""

from __future__ import annotations

from typing import Any

import bpy

from nsm_core.world.actions import Aim

from ..goals.registry import FINDERS
from . import running
from .bones_panel import NSM_PT_bones
from .drawing import Sidebar, sentence
from .properties import action_of, settings_of
from .reviews import pending


class NSM_UL_goals(bpy.types.UIList):
    """One goal a row: enabled, object or place, action."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: Any,
        _data: Any,
        item: Any,
        _icon: int,
        _active: Any,
        _property: str,
        _index: int = 0,
    ) -> None:
        row = layout.row(align=True)
        row.prop(item, "enabled", text="")
        body = row.row(align=True)
        body.active = item.enabled
        action = action_of(item)
        if action is None:
            body.label(text=item.object.name if item.object else "Place", icon="ERROR")
            body.prop(item, "action", text="Choose")
            return
        if action.aim is Aim.HERE:
            body.label(text="Here", icon="PIVOT_CURSOR")
        elif item.object is not None:
            body.label(text=item.object.name, icon="OBJECT_DATA")
        elif action.needs_object:
            body.label(text="No object", icon="ERROR")
        else:
            body.label(text="Place", icon="PIVOT_CURSOR")
        if action.needs_destination:
            to = item.destination
            body.label(text=f"to {to.name}" if to else "No destination", icon="NONE" if to else "ERROR")
        body.prop(item, "action", text="", emboss=False)


class NSM_PT_take(Sidebar, bpy.types.Panel):
    bl_label = "Neural State Machine"
    bl_idname = "NSM_PT_take"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, settings_of(context.scene)
        idle = running.current() is None
        body = layout.column()
        body.enabled = idle
        body.label(text="Character")
        row = body.row(align=True)
        row.prop(settings, "character", text="", icon="ARMATURE_DATA", placeholder="Armature")
        row.operator("nsm.add_character", text="", icon="ADD")
        self._draw_goals(body, settings)
        column = body.column(align=True)
        column.use_property_split, column.use_property_decorate = True, False
        column.prop(settings, "start_frame")
        column.prop(settings, "seed")
        column.prop(settings, "contact_ik")
        self._draw_generate(context, layout)
        self._draw_results(context, layout, settings)

    def _draw_goals(self, layout: Any, settings: Any) -> None:
        layout.label(text="Goals")
        row = layout.row()
        row.template_list("NSM_UL_goals", "", settings, "goals", settings, "active_goal", rows=4)
        side = row.column(align=True)
        side.operator("nsm.goal_add", text="", icon="ADD")
        side.operator("nsm.goal_remove", text="", icon="REMOVE")
        side.separator()
        side.operator("nsm.goal_move", text="", icon="TRIA_UP").direction = "UP"
        side.operator("nsm.goal_move", text="", icon="TRIA_DOWN").direction = "DOWN"
        if 0 <= settings.active_goal < len(settings.goals):
            _draw_goal(layout, settings.goals[settings.active_goal])
        layout.operator("nsm.goal_points", icon="EMPTY_ARROWS")

    def _draw_generate(self, context: bpy.types.Context, layout: Any) -> None:
        state = running.current()
        if state is not None:
            layout.progress(factor=state.fraction, text=state.text)
            layout.label(text="ESC cancels and restores", icon="INFO")
            return
        big = layout.column()
        big.scale_y = 1.5
        big.operator("nsm.generate", icon="PLAY")
        reason = running.reason_not_ready(context)
        if reason:
            sentence(context, layout, reason, "INFO")

    def _draw_results(self, context: bpy.types.Context, layout: Any, settings: Any) -> None:
        if len(settings.results):
            box = layout.box()
            for line in settings.results:
                sentence(context, box, line.text, "CHECKMARK" if line.good else "ERROR")
        if pending(context.scene) is not None:
            row = layout.row(align=True)
            row.operator("nsm.take_accept", icon="CHECKMARK")
            row.operator("nsm.take_reject", icon="X")


def _draw_goal(layout: Any, goal: Any) -> None:
    """The settings of one goal."""
    column = layout.column(align=True)
    column.use_property_split, column.use_property_decorate = True, False
    column.prop(goal, "action")
    action = action_of(goal)
    if action is None:
        column.label(text="Unknown action", icon="ERROR")
        return
    if action.aim is not Aim.HERE:
        column.prop(goal, "object")
    if action.needs_destination:
        column.prop(goal, "destination")
    if goal.object is None and action.aim is Aim.PLACE:
        column.prop(goal, "location")
    if FINDERS[action.key].swings and goal.object is not None:
        column.operator("nsm.door_swing", icon="ARROW_LEFTRIGHT")
    column.prop(goal, "hold")


CLASSES = (NSM_UL_goals, NSM_PT_take, NSM_PT_bones)
