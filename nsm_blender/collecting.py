"""Full collections of Python's garbage, put off while the window must answer.

One goes through everything that Blender, numpy and all add-ons have loaded: 30 ms and more at a time, in
whichever thread happens to make the next object, while all others wait.  Young objects are collected as
always.
"""

from __future__ import annotations

import gc

_NEVER = 1 << 30  # collections of the second generation between two full ones
_held = 0
_before = gc.get_threshold()


class PutOff:
    """No full collection happens from its making until ``end``, however many are held at a time."""

    def __init__(self) -> None:
        global _held, _before
        self._over = False
        if not _held:
            _before = gc.get_threshold()
            gc.set_threshold(*_before[:2], _NEVER)
        _held += 1

    def end(self) -> None:
        """Let them happen again; a second call does nothing."""
        global _held
        if self._over:
            return
        self._over = True
        _held -= 1
        if not _held:
            gc.set_threshold(*_before)

    def __enter__(self) -> PutOff:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()
