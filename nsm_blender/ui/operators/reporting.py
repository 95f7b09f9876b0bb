"""Errors of the core become one sentence in the user's face, never a traceback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

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


def while_idle(operator: type[bpy.types.Operator]) -> bool:
    """Whether no take is under way; the button of an operator that may not run meanwhile then says so."""
    reason = running.reason_busy()
    if reason:
        operator.poll_message_set(reason)
    return not reason
