"""Exceptions raised on purpose: at a call of any function, in the window's thread or beside it."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType

import nsm_blender
import nsm_core

_ROOTS = tuple(str(Path(package.__file__).parent) for package in (nsm_blender, nsm_core))
# What puts back when something was raised before: two faults at once are not asked for.
PUTTING_BACK = {
    "_Work.let_go", "Kept.restore", "SceneState._bones", "SceneState.restore", "FrameState.restore",
    "TakeSession._close", "TakeSession._put_back", "TakeSession._stop", "TakeSession.cancel",
    "_Animation.restore", "_Signs.remove", "_set", "_try", "_with_bones", "made_since", "_numbers_of",
    "_set_numbers", "end_take", "restored_on_failure", "frame_kept", "_redraw", "_Signs._clear_status",
    "_Signs._restore_cursors", "discard_take", "take_off", "take_off_thing", "remove_unused",
    "KeptTakes.restore", "_fill", "Modal._fail", "Modal.modal", "Modal.cancel", "Modal._end",
    "show_results", "settings_of", "exists", "Known.here", "TakeSession._worded",
    "TakeSession.unforeseen", "identity", "Meanwhile.settle", "Meanwhile.restore", "Meanwhile.go_to_chosen",
    "Kept.put_on", "PutOff.end", "take_back", "Kept._restore", "_insert",
}  # fmt: skip
ERRORS = (
    RuntimeError("injected"),
    MemoryError(),
    OSError(28, "No space left on device"),
    ReferenceError("StructRNA of type Object has been removed"),
    KeyError("injected"),
    ValueError("injected"),
    ZeroDivisionError("injected"),
    KeyboardInterrupt(),
)
Point = tuple[str, str, int]  # file, function and number of the call


def _ours(code: CodeType) -> bool:
    return code.co_filename.startswith(_ROOTS) and not code.co_name.startswith("<")


def _name(code: CodeType) -> tuple[str, str]:
    path = Path(code.co_filename)
    root = next(Path(r).parent for r in _ROOTS if code.co_filename.startswith(r))
    return path.relative_to(root).as_posix(), code.co_qualname


@contextmanager
def _traced(tracer) -> Iterator[None]:
    threading.settrace(tracer)
    sys.settrace(tracer)
    try:
        yield
    finally:
        sys.settrace(None)
        threading.settrace(None)


@contextmanager
def counted() -> Iterator[dict[tuple[str, str], int]]:
    """How often each function is called inside, by file and name, in the order of the first calls."""
    calls: dict[CodeType, int] = {}
    named: dict[tuple[str, str], int] = {}

    def tracer(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and _ours(frame.f_code):
            calls[frame.f_code] = calls.get(frame.f_code, 0) + 1

    with _traced(tracer):
        yield named
    for code, count in list(calls.items()):
        if code.co_qualname not in PUTTING_BACK:
            named[_name(code)] = count


@contextmanager
def injected(point: Point, error: BaseException) -> Iterator[list[bool]]:
    """Raise ``error`` at a call of a function inside, once; the list is then no longer empty."""
    file, name, number = point
    raised: list[bool] = []
    seen = 0

    def tracer(frame: FrameType, event: str, _: object) -> None:
        nonlocal seen
        code = frame.f_code
        if event == "call" and code.co_qualname == name and code.co_filename.endswith(file) and not raised:
            seen += 1
            if seen == number:
                raised.append(True)
                raise type(error)(*error.args)

    with _traced(tracer):
        yield raised
