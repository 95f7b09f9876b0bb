"""Gaps of a job file that are to be filled: ``[[fill]]``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nsm_core.errors import NsmError

from ..fill.spec import METHODS
from .entries import begun, flag, frame, known, needed, one_of, read_actor
from .job import JobFill, JobTake
from .paths import require_words

_OUTPUTS = ("report", "out", "sheet", "video")
_KEYS = (
    "name", "character", "rig", "from", "to", "seed", "replace", "method", "overwrite", *_OUTPUTS,
)  # fmt: skip


def read_fill(entry: Any, number: int, folder: Path) -> JobTake:
    """Read entry ``number``, from 1; what is wrong with it is its ``error``."""
    take = JobTake(f"fill {number}")
    try:
        where, wrong = begun(take, entry, "fill", _OUTPUTS, folder)
        known(entry, _KEYS, where)
        if "name" in entry:
            take.name = require_words(entry["name"], f"'name' in {where}")
        if wrong:
            raise wrong
        read_actor(take, entry, where, folder)
        start, end = (frame(needed(entry, key, where), f"'{key}' in {where}") for key in ("from", "to"))
        replace = flag(entry, "replace", where, False)
        take.fill = JobFill(start, end, replace, one_of(entry, "method", where, METHODS))
        take.overwrite = flag(entry, "overwrite", where, take.overwrite)
    except NsmError as error:
        take.error = str(error)
    return take
