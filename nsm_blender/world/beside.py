"""Work beside the window: a thread computes while Blender goes on, and touches Blender's data only while
Blender waits for it.
"""

from __future__ import annotations

import atexit
import threading
import weakref
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from typing import Generic, TypeVar

_T = TypeVar("_T")
_PAUSE = 0.005  # seconds that the window waits for the work before it goes on
_here = threading.local()
_LAST = 5.0  # seconds that the end of the program waits for work that nobody waits for any more


class _GivenUp(Exception):
    """Nobody waits for a piece of work any more."""


class _Work(Generic[_T]):
    """One piece of work; its ``baton`` is held by who may touch Blender's data."""

    def __init__(self, work: Callable[[Callable[[float], None]], _T], touches: bool) -> None:
        self.baton, self.done, self.given_up = threading.RLock(), threading.Event(), False
        self.fraction = 0.0
        self._work, self._touches, self._holds = work, touches, False
        self._result: list[_T] = []
        self._error: BaseException | None = None
        self.baton.acquire()
        _under_way.add(self)
        # A daemon: Blender must be able to quit in the middle of a take.
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        _here.work = self
        try:
            if self._touches:
                self.take_back()
            self._result.append(self._work(self._tell))
        except BaseException as error:  # raised where the result is waited for
            self._error = error
        finally:
            if self._holds:
                self.let_go()
            self.done.set()

    def _tell(self, fraction: float) -> None:
        if self.given_up:
            raise _GivenUp
        self.fraction = fraction

    @property
    def going_on(self) -> bool:
        """Whether there is still something to wait for."""
        return not self.done.is_set() and self._thread.is_alive()

    @property
    def holds(self) -> bool:
        """Whether Blender waits for this work now."""
        return self._holds

    def let_go(self) -> None:
        """Let Blender go on."""
        self._holds = False
        self.baton.release()

    def take_back(self) -> None:
        """Wait until Blender waits."""
        self.baton.acquire()
        self._holds = True
        if self.given_up:
            raise _GivenUp

    def result(self) -> _T:
        """What the work has made; what it raised is raised here."""
        if self._error is not None:
            raise self._error
        if not self._result:
            raise RuntimeError("the work beside the window ended before its time")
        return self._result[0]


_under_way: weakref.WeakSet[_Work] = weakref.WeakSet()


def _give_up() -> None:
    """Have all work end with the program: what a thread still holds would keep Blender, as a package, from
    ending for ever.
    """
    for made in list(_under_way):
        made.given_up = True
        with suppress(RuntimeError):  # not this thread's: nobody waits for it
            made.baton.release()
        made.done.wait(_LAST)


atexit.register(_give_up)


def beside(
    work: Callable[[Callable[[float], None]], _T], touches: bool = False
) -> Generator[float, None, _T]:
    """Do ``work`` in a thread, yielding how far it is, 0..1, every few milliseconds; the value is its result.

    It is given a function to tell how far it is.  Without ``touches`` it must not touch Blender's data at
    all; with it, it does all but what it does ``freely`` while nothing else runs.  What it raises is raised
    here.  Work that is no longer waited for, because the generator is closed, ends where it next tells or
    would touch Blender's data.
    """
    made = _Work(work, touches)
    try:
        while made.going_on:
            made.baton.release()
            made.done.wait(_PAUSE)
            made.baton.acquire()
            if made.going_on:
                yield made.fraction
    finally:
        made.given_up = True
        try:
            made.baton.release()
        except RuntimeError:  # broken off while the work had it: it may be touching Blender's data
            with made.baton:
                pass
    return made.result()


@contextmanager
def freely() -> Iterator[None]:
    """Compute without Blender's data, so that Blender may go on meanwhile; on its own thread this changes
    nothing.
    """
    work: _Work | None = getattr(_here, "work", None)
    if work is None or not work.holds:
        yield
        return
    work.let_go()
    try:
        yield
    finally:
        work.take_back()
