"""Generate: a modal operator that steps a take within a time budget, so that the window never freezes."""

from __future__ import annotations

import time
from typing import ClassVar

import bpy

from nsm_core.errors import NsmError

from .. import running
from ..properties import settings_of, show_results, spec_of_row
from ..report import result_lines
from ..session import Session
from ..takes import Take, TakeSpec, finish, generate
from . import review

_BUDGET = 0.04  # seconds of stepping between two redraws
_SLOW_BUDGET = 0.2  # the same where a redraw itself takes long: it must not starve the stepping
_TICK = 0.02
# The view may be turned and zoomed while a take runs; everything else would change what it reads.
_VIEW_EVENTS = {
    "MIDDLEMOUSE",
    "WHEELUPMOUSE",
    "WHEELDOWNMOUSE",
    "MOUSEMOVE",
    "INBETWEEN_MOUSEMOVE",
    "TRACKPADPAN",
    "TRACKPADZOOM",
    "NDOF_MOTION",
}


def spec_of(scene: bpy.types.Scene) -> TakeSpec:
    """Return the take that the sidebar asks for."""
    settings = settings_of(scene)
    return TakeSpec(
        character=settings.character,
        goals=[spec_of_row(row) for row in settings.goals if row.enabled],
        start_frame=settings.start_frame,
        seed=settings.seed,
        contact_ik=settings.contact_ik,
    )


class NSM_OT_generate(bpy.types.Operator):
    bl_idname = "nsm.generate"
    bl_label = "Generate"
    bl_description = "Have the character do the enabled goals and key the motion in a new action"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        reason = running.reason_not_ready(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Generate in one go: scripts and background mode, where no timer runs."""
        scene = context.scene
        try:
            take = finish(generate(spec_of(scene), scene))
        except NsmError as error:
            return self._fail(scene, str(error))
        return self._keep(scene, take)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self._start(context)

    def _start(self, context: bpy.types.Context) -> set[str]:
        self._session = Session(spec_of(context.scene), context.scene)
        manager = context.window_manager
        self._timer = manager.event_timer_add(_TICK, window=context.window)
        manager.modal_handler_add(self)
        manager.progress_begin(0, 100)
        self._left = time.perf_counter()
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, "Generate was cancelled; everything is as it was.")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type in _VIEW_EVENTS else {"RUNNING_MODAL"}
        session, drawing = self._session, time.perf_counter() - self._left
        try:
            take = session.tick(min(max(_BUDGET, drawing), _SLOW_BUDGET))
        except NsmError as error:
            self._end(context)
            return self._fail(session.scene, str(error))
        except Exception:
            self._end(context)
            raise
        if take is not None:
            self._end(context)
            return self._keep(session.scene, take)
        context.window_manager.progress_update(round(100 * session.fraction))
        context.workspace.status_text_set(f"NSM: {session.text}   ESC: cancel and restore")
        _redraw(context)
        self._left = time.perf_counter()
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop and put everything back: called on ESC, and by Blender when its window closes."""
        self._session.cancel()
        self._end(context)

    def _end(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        _redraw(context)

    def _keep(self, scene: bpy.types.Scene, take: Take) -> set[str]:
        lines = result_lines(take.report, take.keyed.frame_start, scene.frame_end)
        show_results(settings_of(scene), lines)
        review.remember(scene, take.keyed)
        for goal, (text, good) in zip(take.report["goals"], lines, strict=False):
            self.report({"INFO" if goal["reached"] and good else "WARNING"}, text)
        return {"FINISHED"}

    def _fail(self, scene: bpy.types.Scene, sentence: str) -> set[str]:
        show_results(settings_of(scene), [(sentence, False)])
        self.report({"ERROR"}, sentence)
        return {"CANCELLED"}


def _redraw(context: bpy.types.Context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


CLASSES = (NSM_OT_generate,)
