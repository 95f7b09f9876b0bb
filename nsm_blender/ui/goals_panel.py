"""What the character does: the queue of goals, and the settings of the one that is chosen in it."""

from __future__ import annotations

from typing import Any

import bpy

from nsm_core.world.actions import Aim

from . import lookout, queue_files, running
from .drawing import Sidebar, sentence
from .properties import action_of, queue_of
from .ways import draw_way


class NSM_UL_goals(bpy.types.UIList):
    """One goal a row: enabled, object or place, action."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: Any,
        _data: Any,
        item: Any,
        _icon: int,
        _active: Any,
        _property: str,
        index: int = 0,
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
        if item.enabled:
            problem, checked = judged(context.scene, index, item)
            body.label(text="", icon="ERROR" if problem else "CHECKMARK" if checked else "BLANK1")


def judged(scene: bpy.types.Scene, index: int, row: Any) -> tuple[str, bool]:
    """Why a row of the queue cannot be done, as a sentence, empty where nothing is known against it; and
    whether it was checked in the scene as it is.
    """
    problem = running.problem_of_row(index + 1, row, scene)
    told = None if problem else lookout.told_of(scene, index, row)
    return (told.problem, True) if told is not None else (problem, False)


class NSM_MT_queues(bpy.types.Menu):
    """The queues that are kept."""

    bl_idname = "NSM_MT_queues"
    bl_label = "Queues"

    def draw(self, _context: bpy.types.Context) -> None:
        layout, names = self.layout, queue_files.saved()
        layout.operator("nsm.queue_save", icon="ADD")
        if names:
            layout.separator()
        for name in names:
            layout.operator("nsm.queue_load", text=name, icon="PRESET").name = name
        if names:
            layout.separator()
        for name in names:
            layout.operator("nsm.queue_delete", text=f"Delete {name}", icon="TRASH").name = name


class NSM_PT_goals(Sidebar, bpy.types.Panel):
    bl_label = "Goals"
    bl_idname = "NSM_PT_goals"
    bl_parent_id = "NSM_PT_motion"

    def draw(self, context: bpy.types.Context) -> None:
        layout, queue = self.layout, queue_of(context.scene)
        idle = running.current() is None
        row = layout.row()
        rows = row.column()
        rows.enabled = idle
        rows.template_list("NSM_UL_goals", "", queue, "goals", queue, "active_goal", rows=4)
        side = row.column(align=True)
        side.operator("nsm.goal_add", text="", icon="ADD")
        side.operator("nsm.goal_remove", text="", icon="REMOVE")
        side.menu("NSM_MT_queues", text="", icon="DOWNARROW_HLT")
        side.separator()
        side.operator("nsm.goal_move", text="", icon="TRIA_UP").direction = "UP"
        side.operator("nsm.goal_move", text="", icon="TRIA_DOWN").direction = "DOWN"
        if 0 <= queue.active_goal < len(queue.goals):
            column = layout.column()
            column.enabled = idle
            chosen = queue.goals[queue.active_goal]
            _draw_goal(column, chosen)
            problem, _ = judged(context.scene, queue.active_goal, chosen)
            if problem and chosen.enabled:
                sentence(context, layout, problem, "ERROR")
        row = layout.row(align=True)
        row.operator("nsm.check_goals", icon="CHECKMARK")
        row.operator("nsm.goal_points", icon="EMPTY_ARROWS")
        if lookout.under_way():
            layout.label(text="Looking at the scene ...", icon="SORTTIME")


def _draw_goal(layout: Any, goal: Any) -> None:
    """The settings of one goal."""
    from ..goals.registry import FINDERS

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
        weight = column.row(align=True, heading="Weight")
        weight.prop(goal, "own_mass", text="")
        kilograms = weight.row()
        kilograms.active = goal.own_mass
        kilograms.prop(goal, "mass", text="kg")
    if action.pairs:
        column.prop(goal, "close_after")
    if goal.object is None and action.aim is Aim.PLACE:
        column.prop(goal, "location")
        column.operator("nsm.goal_pick", icon="RESTRICT_SELECT_OFF")
        column.operator("nsm.goal_to_cursor", icon="PIVOT_CURSOR")
    draw_way(column, goal)
    if FINDERS[action.key].swings and goal.object is not None:
        column.operator("nsm.door_swing", icon="ARROW_LEFTRIGHT")
    if action.aim is not Aim.HERE:
        when = column.row(align=True, heading="Reached at")
        when.prop(goal, "at_frame", text="")
        frame = when.row()
        frame.active = goal.at_frame
        frame.prop(goal, "by", text="Frame")
    held = column.row(align=True)
    held.prop(goal, "hold")
    held.prop(goal, "hold_frames", text="")
