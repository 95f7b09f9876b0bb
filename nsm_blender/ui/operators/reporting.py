"""Errors of the core become one sentence in the user's face, never a traceback."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, ClassVar

import bpy

from nsm_core.errors import NsmError

from .. import running


@contextmanager
def sentences(operator: bpy.types.Operator) -> Iterator[list[str]]:
    """Report an NsmError raised inside as the operator's ERROR; the list then holds its sentence."""
    raised: list[str] = []
    try:
        yield raised
    except NsmError as error:
        raised.append(str(error))
        operator.report({"ERROR"}, str(error))


def telling(act: Callable[[Any, bpy.types.Context], set[str] | None]) -> Callable[..., set[str]]:
    """Make the ``execute`` of an operator from what it does: an NsmError raised there is reported as its
    ERROR and cancels it; where nothing is returned it is finished.
    """

    @wraps(act)
    def execute(self: Any, context: bpy.types.Context) -> set[str]:  # Blender counts these arguments
        with sentences(self):
            return act(self, context) or {"FINISHED"}
        return {"CANCELLED"}

    return execute


class Guarded:
    """What an operator that changes the file shares: it can be undone, and its button says why it is off."""

    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        reason = cls.reason_off(context)
        if reason:
            cls.poll_message_set(reason)  # type: ignore[attr-defined]
        return not reason

    @classmethod
    def reason_off(cls, context: bpy.types.Context) -> str:
        """Why it cannot run now, as a sentence with what to do; empty when it can."""
        raise NotImplementedError


class WhileIdle(Guarded):
    """An operator that waits while a take is under way."""

    @classmethod
    def reason_off(cls, context: bpy.types.Context) -> str:
        return running.reason_busy() or cls.reason_not(context)

    @classmethod
    def reason_not(cls, _context: bpy.types.Context) -> str:
        """Why it cannot run though no take is under way; empty when it can."""
        return ""


class InObjectMode(WhileIdle):
    """An operator that adds objects; ``adds`` says what it does, in a sentence's beginning."""

    adds = ""

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        if context.mode == "OBJECT":
            return ""
        return f"{cls.adds} in Object Mode; leave the present mode with Tab."
