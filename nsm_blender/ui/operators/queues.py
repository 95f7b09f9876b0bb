"""Queues of goals that are kept: saved, loaded, deleted by name."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bpy.props import StringProperty

from nsm_core.errors import GoalError

from .. import queue_files
from ..queue import queue_of
from .reporting import WhileIdle, telling


class _OnQueue(WhileIdle, bpy.types.Operator):
    bl_options: ClassVar = {"REGISTER"}  # files, which undo does not reach
    name: StringProperty(name="Name", description="What the queue is called", options={"SKIP_SAVE"})


class NSM_OT_queue_save(_OnQueue):
    bl_idname = "nsm.queue_save"
    bl_label = "Save Queue"
    bl_description = "Keep these goals under a name, for other scenes; objects are found again by their names"

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        return "The list of goals is empty; add one first." if not len(queue_of(context.scene).goals) else ""

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_props_dialog(self)

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        path = queue_files.path_of(self.name)
        queue_files.save_queue(path, queue_of(context.scene).goals)
        self.report({"INFO"}, f"The queue is kept as {path.stem}.")


class NSM_OT_queue_load(_OnQueue):
    bl_idname = "nsm.queue_load"
    bl_label = "Load Queue"
    bl_description = "Replace the goals by those that are kept under this name"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        path = queue_files.path_of(self.name)
        if not path.is_file():
            raise GoalError(f"There is no queue called {self.name}; save one first.")
        missing = queue_files.load_queue(path, queue_of(context.scene), context.scene)
        if missing:
            few = ", ".join(missing[:3]) + (f" and {len(missing) - 3} more" if len(missing) > 3 else "")
            self.report(
                {"WARNING"}, f"This scene has no object called {few}; choose others in the marked goals."
            )


class NSM_OT_queue_delete(_OnQueue):
    bl_idname = "nsm.queue_delete"
    bl_label = "Delete Kept Queue"
    bl_description = "Delete the file of a queue that is kept; the goals in the list stay"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_confirm(self, event)

    @telling
    def execute(self, _context: bpy.types.Context) -> None:
        path = queue_files.path_of(self.name)
        try:
            path.unlink()
        except OSError as error:
            raise GoalError(f"{path.name} cannot be deleted ({error.strerror}).") from error


CLASSES = (NSM_OT_queue_save, NSM_OT_queue_load, NSM_OT_queue_delete)
