"""Looking at goals and ways before a take, in slices while nothing else is done; kept until the scene
changes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy

from nsm_core.errors import NsmError

from ..animation.identity import Known, identity
from ..overlays.layers import LAYERS
from . import running
from .queue import queue_of

if TYPE_CHECKING:
    from ..outlook import GoalOutlook, Outlook
    from ..overlays.shapes import Shapes
    from ..prepare import TakeSpec
    from ..progress import Progress

_BUDGET, _TICK = 0.02, 0.02  # seconds of work at a time, and between two
_REST = 0.4  # seconds without a change after which one looks again
_BUSY = 0.5  # seconds until one asks again whether playback, or a take, has ended


@dataclass
class _Look:
    """One look at the scene: under way while it has ``steps``."""

    scene: Known
    frame: float
    rows: dict[int, tuple[Any, ...]]  # of the queue, by their index: what they asked for
    steps: Generator[Progress, None, tuple[Outlook, dict[str, Shapes]]] | None = None
    seen: Outlook | None = None
    problem: str = ""
    by_row: dict[int, GoalOutlook] = field(default_factory=dict)
    shapes: dict[str, Shapes] = field(default_factory=dict)  # by the overlay


_look: _Look | None = None
_asked: Known | None = None  # the scene to look at next
_due = 0.0
_stale = False
_heard: list[Callable[[], None]] = []


def on_change(heard: Callable[[], None]) -> None:
    """Have ``heard`` called whenever there is something new to show."""
    if heard not in _heard:
        _heard.append(heard)


def ask(scene: bpy.types.Scene, rest: float = 0.0) -> None:
    """Look at a scene as soon as nothing has changed for ``rest`` seconds; what is known is shown until
    then.
    """
    global _asked, _due
    _asked, _due = Known(scene), time.monotonic() + rest
    if not bpy.app.background and not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=_TICK)
    _tell()


def look_now(scene: bpy.types.Scene) -> None:
    """Look in one go: scripts and background mode, where no timer runs."""
    _begin(scene)
    while _look is not None and _look.steps is not None:
        _step()


def under_way() -> bool:
    """Whether a look is under way, or about to begin."""
    return _asked is not None or (_look is not None and _look.steps is not None)


def seen(scene: bpy.types.Scene) -> Outlook | None:
    """What was seen of a scene last; None before the first look, and of another scene."""
    return _look.seen if _look is not None and _look.scene.here and _look.scene.block == scene else None


def shapes(scene: bpy.types.Scene, key: str) -> Shapes | None:
    """What an overlay draws of what was seen of a scene last."""
    return _look.shapes.get(key) if _look is not None and seen(scene) is not None else None


def problem(scene: bpy.types.Scene) -> str:
    """Why there is nothing to see of a scene, as a sentence; empty where there is, or nothing was asked."""
    here = _look is not None and _look.scene.here and _look.scene.block == scene
    return _look.problem if here and _look is not None else ""


def told_of(scene: bpy.types.Scene, index: int, row: Any) -> GoalOutlook | None:
    """What is known of a row of the queue; None where it was not looked at, or anything has changed since."""
    if _look is None or _stale or seen(scene) is None or _look.rows.get(index) != _asks(row):
        return None
    return _look.by_row.get(index)


def note_change() -> None:
    """What was seen is no longer what is there."""
    global _stale
    if not _stale:
        _stale = True
        _tell()


def is_stale() -> bool:
    """Whether the scene has changed since, or nothing was seen."""
    return _stale or _look is None


def stop() -> None:
    """Break a look off; what was seen before it is gone, too."""
    global _look, _asked
    look, _look, _asked = _look, None, None
    if look is not None and look.steps is not None:
        _close(look)


def _close(look: _Look) -> None:
    steps, look.steps = look.steps, None
    try:
        steps.close()
    except Exception:  # what a generator does on its way out may meet what is gone
        _log("A look did not close")


def _log(what: str) -> None:
    import logging  # which costs what half of the sidebar does

    logging.getLogger(__name__).debug(what, exc_info=True)


def _begin(scene: bpy.types.Scene) -> None:
    global _look, _asked, _stale
    from .operators.generate import spec_of  # which is imported with the operators that ask for a look

    before = _look
    if before is not None and before.steps is not None:
        _close(before)
    bpy.context.view_layer.update()  # what waits to be brought up to date is no change of what will be seen
    _asked, _stale = None, False
    rows = {i: row for i, row in enumerate(queue_of(scene).goals) if row.enabled}
    _look = _Look(Known(scene), scene.frame_current_final, {i: _asks(row) for i, row in rows.items()})
    if before is not None:
        if before.scene.block == scene:  # shown until there is more
            _look.seen, _look.shapes = before.seen, before.shapes
    try:
        _look.steps = _steps(spec_of(scene), scene)
    except NsmError as error:
        _look.problem, _look.seen, _look.shapes = str(error), None, {}
    _tell()


def _steps(
    spec: TakeSpec, scene: bpy.types.Scene
) -> Generator[Progress, None, tuple[Outlook, dict[str, Shapes]]]:
    """Look, and have a thread make what the overlays draw of it."""
    from ..outlook import outlook
    from ..progress import waited

    found = yield from outlook(spec, scene)
    made = yield from waited(
        "Making the overlays", lambda _: {la.key: la.before(found) for la in LAYERS if la.before is not None}
    )
    return found, made


def _step() -> bool:
    """One step; whether it only waits for a thread."""
    look = _look
    assert look is not None and look.steps is not None
    try:
        return next(look.steps).waits
    except StopIteration as done:
        look.steps, (look.seen, look.shapes), look.problem = None, done.value, ""
        look.by_row = dict(zip(look.rows, look.seen.goals, strict=True))
    except NsmError as error:
        look.steps, look.seen, look.shapes, look.problem = None, None, {}, str(error)
    except Exception:  # something that is read was deleted meanwhile: the change is heard, too
        _log("A look was broken off")
        look.steps, look.seen, look.shapes, look.problem = None, None, {}, ""
        note_change()
    _tell()
    return True


def tick() -> float | None:
    """What a timer does, and scripts where no timer runs: a few milliseconds of work; the seconds until the
    next, None when there is nothing left to do.
    """
    if running.current() is not None or _plays():
        return _BUSY
    now = time.monotonic()
    if _asked is not None:
        if not _asked.here:
            stop()
            return None
        if now < _due:
            return _due - now
        with _window_of(_asked.block):
            _begin(_asked.block)
    if _look is None or _look.steps is None:
        return None
    if not _look.scene.here:
        stop()
        return None
    scene = _look.scene.block
    if _stale or scene.frame_current_final != _look.frame:  # changed on the way: from the start
        _close(_look)
        ask(scene, _REST)
        return _REST
    with _window_of(scene):
        until = time.perf_counter() + _BUDGET
        while _look is not None and _look.steps is not None and time.perf_counter() < until:
            if _step():
                break
    return _TICK if _look is not None and _look.steps is not None else None


def _window_of(scene: bpy.types.Scene) -> Any:
    """The context of a window that shows the scene: a timer has none of its own."""
    for window in bpy.context.window_manager.windows:
        if window.scene == scene:
            return bpy.context.temp_override(window=window)
    return nullcontext()


def _plays() -> bool:
    return any(window.screen.is_animation_playing for window in bpy.context.window_manager.windows)


def _asks(row: Any) -> tuple[Any, ...]:
    """What a row asks for, to tell whether it has been changed."""
    things = [identity(o) if o is not None else None for o in (row.object, row.destination)]
    return row.action, row.enabled, *things, tuple(row.location)


def _tell() -> None:
    for heard in _heard:
        with suppress(ReferenceError):
            heard()


def uninstall() -> None:
    """End all work and forget who listens."""
    stop()
    _heard.clear()
    if not bpy.app.background and bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
