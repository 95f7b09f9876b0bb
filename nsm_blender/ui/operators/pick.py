"""Pick a place: a click into the viewport says where the chosen goal is, or adds one to walk there."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import bpy
from bpy.props import FloatVectorProperty
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector

from nsm_core.errors import NsmError
from nsm_core.world.actions import ACTIONS, Aim

from .. import running
from ..properties import NsmGoal, action_of, queue_of, settings_of
from ..queue import flow_on
from .modal import VIEW_EVENTS
from .reporting import WhileIdle

_TOLD = "Click where the character is to go.   Right click or ESC: leave it as it is"


class NSM_OT_goal_pick(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.goal_pick"
    bl_label = "Pick a Place"
    bl_description = (
        "Click into the viewport where the character is to go: on the floor, on a rug or on what it can "
        "climb; a click on a wall means the floor before it. The chosen goal takes that place if it has one "
        "of its own; else a goal to walk there is added"
    )

    location: FloatVectorProperty(name="Place", subtype="TRANSLATION", size=3)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the place that was picked."""
        queue = queue_of(context.scene)
        goal = queue.goals[queue.active_goal] if 0 <= queue.active_goal < len(queue.goals) else None
        if goal is None or not _has_place(goal):
            goal = queue.goals.add()
            goal.action = next(a.key for a in ACTIONS if a.aim is Aim.PLACE)
            flow_on(goal)
            queue.active_goal = len(queue.goals) - 1
        goal.location = self.location
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        context.window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(_TOLD)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if running.current() is not None or event.type in {"ESC", "RIGHTMOUSE"}:
            return self._end(context, {"CANCELLED"})
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"} if event.type in VIEW_EVENTS else {"RUNNING_MODAL"}
        region, view = _region_at(context, event.mouse_x, event.mouse_y)
        if region is None:
            self.report({"INFO"}, "That is no viewport; click where the character is to go.")
            return {"RUNNING_MODAL"}
        at = Vector((event.mouse_x - region.x, event.mouse_y - region.y))
        origin, direction = region_2d_to_origin_3d(region, view, at), region_2d_to_vector_3d(region, view, at)
        place = picked(context.scene, origin, direction)
        if place is None:
            self.report({"INFO"}, "There is no floor under the mouse; click on the floor or on an object.")
            return {"RUNNING_MODAL"}
        self.location = place
        return self._end(context, self.execute(context))

    def cancel(self, context: bpy.types.Context) -> None:
        """Put the cursor back where Blender ends it, as when a file is opened."""
        self._end(context, {"CANCELLED"})

    def _end(self, context: bpy.types.Context, answer: set[str]) -> set[str]:
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return answer


def picked(scene: bpy.types.Scene, origin: Vector, direction: Vector) -> Vector | None:
    """The place that a ray points at, on the floor of the scene's character, through the character itself."""
    from ...prepare import own_objects, start_of
    from ...world.picking import picked_place

    character = settings_of(scene).character
    floor, metre, own = 0.0, 1.0, set()
    if character is not None:
        own = own_objects(character, scene)
        with suppress(NsmError):  # a rig that cannot act has no floor of its own
            frame, _ = start_of(character, scene)
            floor, metre = frame.floor, frame.scale
    return picked_place(scene, origin, direction, floor, metre, own)


def _has_place(goal: NsmGoal) -> bool:
    return goal.object is None and getattr(action_of(goal), "aim", None) is Aim.PLACE


def _region_at(context: bpy.types.Context, x: int, y: int) -> tuple[Any, Any]:
    """The viewport's region under the mouse, and its view."""
    for area in context.screen.areas:
        if area.type == "VIEW_3D":
            for region in area.regions:
                inside = region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
                if region.type == "UI" and inside and region.width > 1:
                    return None, None
            for region in area.regions:
                inside = region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
                if region.type == "WINDOW" and inside:
                    return region, area.spaces.active.region_3d
    return None, None


CLASSES = (NSM_OT_goal_pick,)
