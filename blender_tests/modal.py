"""What a window does for the modal operator, which background mode lacks."""

from __future__ import annotations

import types

import bpy

from nsm_blender.ui.operators.generate import NSM_OT_generate


class Window:
    """Takes the place of a window's context, which background mode has not: notes what the modal operator
    asks of it.
    """

    def __init__(self, _scene: bpy.types.Scene | None = None) -> None:
        self.window, self.workspace, self.window_manager = self, self, self
        self.windows: list[object] = []
        self.timers, self.handlers, self.status = 0, 0, None

    @property
    def scene(self) -> bpy.types.Scene:
        """The scene that the window shows now."""
        return bpy.context.scene

    def event_timer_add(self, _step, window):
        assert window is self
        self.timers += 1
        return "timer"

    def event_timer_remove(self, timer):
        assert timer == "timer"
        self.timers -= 1

    def modal_handler_add(self, _operator):
        self.handlers += 1

    def status_text_set(self, text):
        self.status = text

    def progress_begin(self, *_):
        pass

    progress_update = progress_end = progress_begin


class Modal:
    """The modal operator's functions on a plain object, as Blender would call them."""

    def __init__(self, window: Window, operator: type[bpy.types.Operator] = NSM_OT_generate) -> None:
        self.window, self.reports, self.beside = window, [], getattr(operator, "beside", False)
        for name in ("modal", "cancel", "_start", "_open", "_end", "_keep", "_fail", "_asked", "_steps_of"):
            if hasattr(operator, name):
                setattr(self, name, types.MethodType(getattr(operator, name), self))

    def report(self, kind, text):
        self.reports.append((kind, text))

    def event(self, kind: str) -> set[str]:
        return self.modal(self.window, types.SimpleNamespace(type=kind, value="PRESS"))
