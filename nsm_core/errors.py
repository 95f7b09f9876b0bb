"""One tree of errors; every message is a plain sentence that says what to do next."""

from __future__ import annotations

import re

_LONGEST_WORD = 1000  # letters: more than any path that a system opens by name


class NsmError(Exception):
    """Base of everything this project raises on bad input.

    Whatever names of files, joints or objects a message quotes, it stays one line that any terminal can
    print.
    """

    def __init__(self, message: object = "") -> None:
        text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in str(message))
        super().__init__(re.sub(rf"(\S{{100}})\S{{{_LONGEST_WORD},}}", r"\1...", text))


class SkeletonError(NsmError):
    """Joints are missing, renamed or in the wrong hierarchy."""


class CaptureError(NsmError):
    """A motion capture file cannot be read or holds values that are not numbers."""


class WeightsError(NsmError):
    """A weights file is missing, truncated, foreign or of another layout."""


class GeometryError(NsmError):
    """A mesh or object cannot serve as a collider or goal."""


class GoalError(NsmError):
    """A goal is unknown, incomplete or cannot be reached."""


class GapError(NsmError):
    """Missing frames that cannot be filled: too few, too many, or with nothing on one side."""


class JobError(NsmError):
    """A job file or one of its entries is wrong."""


class OutputError(NsmError):
    """A result cannot be written where it was asked for."""
