"""Check Goals: which goals cannot be reached is told before a take is made."""

from __future__ import annotations

import bpy

from .. import lookout, running
from ..queue import queue_of
from .reporting import while_idle


class NSM_OT_check_goals(bpy.types.Operator):
    bl_idname = "nsm.check_goals"
    bl_label = "Check Goals"
    bl_description = (
        "Look at the scene as it is now and tell, in the list, which goals cannot be reached and why. The "
        "window stays free meanwhile; the answer holds until something changes"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not while_idle(cls):
            return False
        reason = running.reason_no_character(context.scene)
        if not reason and not any(row.enabled for row in queue_of(context.scene).goals):
            reason = "No goal is enabled; add one to the list, or tick one."
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        if not bpy.app.background:
            lookout.ask(scene)
            return {"FINISHED"}
        lookout.look_now(scene)
        problem = lookout.problem(scene)
        if problem:
            self.report({"ERROR"}, problem)
            return {"CANCELLED"}
        for index, row in enumerate(queue_of(scene).goals):
            told = lookout.told_of(scene, index, row)
            if told is not None and told.problem:
                self.report({"WARNING"}, f"Goal {index + 1}: {told.problem}")
        return {"FINISHED"}


CLASSES = (NSM_OT_check_goals,)
