"""Errors of the core become one sentence in the user's face, never a traceback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from nsm_core.errors import NsmError


@contextmanager
def sentences(operator: bpy.types.Operator) -> Iterator[list[str]]:
    """Report an NsmError raised inside as the operator's ERROR; the list then holds its sentence."""
    raised: list[str] = []
    try:
        yield raised
    except NsmError as error:
        raised.append(str(error))
        operator.report({"ERROR"}, str(error))
