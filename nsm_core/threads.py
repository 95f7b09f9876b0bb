"""Keep numpy's matrix products on one thread while a single character is stepped.

One character's matrices are too small to share: with a second thread a step takes no less time on an idle
machine and many times more on a busy one, since the threads wait for each other (2 against 60 ms were
measured beside a running render).
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

_SUFFIXES = ("64_", "")
_PREFIXES = ("scipy_openblas", "openblas")


@functools.cache
def _openblas() -> tuple[Callable[[], int], Callable[[int], None]] | None:
    """Getter and setter of the thread count of the OpenBLAS that numpy brought along; None with another
    library.
    """
    package = Path(np.__file__).parent
    for folder in (package.parent / "numpy.libs", package / ".dylibs"):
        for path in sorted(folder.glob("*openblas*")) if folder.is_dir() else ():
            try:
                library = ctypes.CDLL(str(path))
            except OSError:
                continue
            for prefix in _PREFIXES:
                for suffix in _SUFFIXES:
                    get, put = f"{prefix}_get_num_threads{suffix}", f"{prefix}_set_num_threads{suffix}"
                    if hasattr(library, get) and hasattr(library, put):
                        return getattr(library, get), getattr(library, put)
    return None


@contextmanager
def one_thread() -> Iterator[None]:
    """Run numpy's OpenBLAS on one thread inside the block; does nothing where numpy uses another library."""
    with threads(1):
        yield


@contextmanager
def threads(count: int) -> Iterator[None]:
    """The same on ``count`` threads."""
    functions = _openblas()
    if functions is None:
        yield
        return
    get, put = functions
    before = get()
    put(count)
    try:
        yield
    finally:
        put(before)
