"""Work that a window shows and ESC breaks off: stepped within a time budget, so that the window never
freezes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import bpy

from nsm_core.errors import NsmError

from ...animation.identity import exists
from ..properties import settings_of, show_results
from ..session import TakeSession

_BUDGET = 0.03  # seconds of stepping at a time: clicks and ESC are heard that often
_SLOWEST_PREVIEW = 0.5  # seconds of stepping between two redraws, at most, where a redraw itself takes long
_TICK = 0.02
# The view may be turned and zoomed while a take runs; everything else would change what it reads.
VIEW_EVENTS = {
    "MIDDLEMOUSE",
    "WHEELUPMOUSE",
    "WHEELDOWNMOUSE",
    "MOUSEMOVE",
    "INBETWEEN_MOUSEMOVE",
    "TRACKPADPAN",
    "TRACKPADZOOM",
    "NDOF_MOTION",
}


class _Signs:
    """What a window shows of a take under way: timer, status bar, cursor.  Taken away once, whoever ends the
    take.

    It holds no operator: Blender may have freed that one by then.
    """

    def __init__(self, context: bpy.types.Context) -> None:
        self._context, self._workspaces = context, []
        self._timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        context.window_manager.progress_begin(0, 100)
        self._tagged, self._resumed, self._redraw = 0.0, 0.0, 0.0

    def due(self) -> bool:
        """Whether the window should show the newest frame: redraws may take half of the time, however long
        each one takes.
        """
        now = time.perf_counter()
        if self._tagged > self._resumed:  # what has passed since is the redraw's, and the timer's
            self._redraw, self._resumed = min(max(now - self._tagged - _TICK, 0.0), _SLOWEST_PREVIEW), now
        return now - self._resumed >= self._redraw

    def show(self, context: bpy.types.Context, session: TakeSession) -> None:
        """Have sidebar, status bar and viewports drawn anew."""
        context.window_manager.progress_update(round(100 * session.fraction))
        if context.workspace not in self._workspaces:
            self._workspaces.append(context.workspace)
        context.workspace.status_text_set(f"NSM: {session.text}   ESC: cancel and restore")
        # The scene itself, which may take seconds to draw, only where something in it has changed.
        _redraw(context, ("WINDOW", "UI") if session.posed else ("UI",))
        self._tagged = time.perf_counter()

    def remove(self) -> None:
        """Take everything away; a second call does nothing."""
        timer, self._timer = self._timer, None
        if timer is None:
            return
        manager = self._context.window_manager
        for take_away in (
            lambda: manager.event_timer_remove(timer),
            manager.progress_end,
            self._restore_cursors,
            self._clear_status,
        ):
            with suppress(ReferenceError, AttributeError, RuntimeError):  # windows and workspaces may be gone
                take_away()
        _redraw(self._context, ("WINDOW", "UI"))

    def _restore_cursors(self) -> None:
        for window in self._context.window_manager.windows:  # progress_end knows the active one alone
            window.cursor_modal_restore()

    def _clear_status(self) -> None:
        for workspace in self._workspaces:
            with suppress(ReferenceError):
                workspace.status_text_set(None)


class Modal:
    """What Generate and Show Goal Points share: a session is opened, ticked by a timer, and its value
    kept.
    """

    def _open(self, context: bpy.types.Context, ended: Callable[[], None]) -> TakeSession:
        """Open the session; ``ended`` is called once when it is over."""
        raise NotImplementedError

    def _keep(self, scene: bpy.types.Scene, value: Any) -> set[str]:
        """Do what is left when the session is done."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self._start(context)

    def _start(self, context: bpy.types.Context) -> set[str]:
        signs = _Signs(context)
        try:
            self._session = self._open(context, signs.remove)
        except NsmError as error:
            signs.remove()
            return self._fail(context.scene, str(error))
        except BaseException:
            signs.remove()
            raise
        self._signs = signs
        try:
            context.window_manager.modal_handler_add(self)
        except BaseException:
            self._session.cancel()
            raise
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        session, signs = self._session, self._signs
        if session.over:  # undone, or ended by a script: nothing of this event is ours
            return self._fail(context.scene, session.why) | {"PASS_THROUGH"}
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, session.why)
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type in VIEW_EVENTS else {"RUNNING_MODAL"}
        try:
            due = signs.due()
            value = session.tick(_BUDGET, due)
            if value is None:
                if due:
                    signs.show(context, session)
                return {"RUNNING_MODAL"}
            try:
                return self._keep(session.scene, value)
            except BaseException:
                take_back(session.scene, value)
                raise
        except NsmError as error:
            return self._fail(context.scene, str(error))
        except Exception as error:  # of the window, or once the take is over
            why = session.unforeseen(error)
            session.cancel()
            return self._fail(context.scene, why)
        except BaseException:
            session.cancel()
            raise

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop and put everything back: called on ESC, and by Blender when its window closes or another file
        is opened.
        """
        self._session.cancel()
        self._end(context)

    def _end(self, _context: bpy.types.Context) -> None:
        self._signs.remove()

    def _fail(self, scene: bpy.types.Scene, sentence: str) -> set[str]:
        scene = scene if exists(scene) else bpy.context.scene
        show_results(settings_of(scene), [(sentence, False)])
        self.report({"ERROR"}, sentence)
        return {"CANCELLED"}


def take_back(scene: bpy.types.Scene, value: Any) -> None:
    """Discard those takes of a session's value that did not come onto the list: nobody could reject them."""
    from ...keys.keyed import discard_take

    listed = [record.character.action for record in settings_of(scene).takes]
    for take in reversed(value if isinstance(value, list) else [value]):
        made = getattr(take, "keyed", None)
        if made is not None and exists(made.action) and made.action not in listed:
            discard_take(made)


def _redraw(context: bpy.types.Context, regions: tuple[str, ...]) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type in regions:
                        region.tag_redraw()
