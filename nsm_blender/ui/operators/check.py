"""Check Goals: which goals cannot be reached is told before a take is made."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .. import lookout, running
from ..queue import queue_of
from .reporting import WhileIdle


class NSM_OT_check_goals(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.check_goals"
    bl_label = "Check Goals"
    bl_description = (
        "Look at the scene as it is now and tell, in the list, which goals cannot be reached and why. The "
        "window stays free meanwhile; the answer holds until something changes"
    )

    bl_options: ClassVar = {"REGISTER"}  # nothing of the file changes

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        reason = running.reason_no_character(context.scene)
        if not reason and not any(row.enabled for row in queue_of(context.scene).goals):
            return "No goal is enabled; add one to the list, or tick one."
        return reason

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
