"""Write files whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import OutputError
from .validate import shown


@contextmanager
def atomic_path(final: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``final`` to write to; it takes the place of ``final`` at the end, or is
    removed on failure.

    A killed process or a full disk leaves the old file or the new one, never a half.  Links are followed, the
    mode of a file that is replaced is kept, and what is no plain file (``/dev/null``) is written to directly.
    OSError passes through.
    """
    final = Path(os.path.realpath(final))
    if final.exists() and not final.is_file():
        yield final
        return
    # The ending stays last: some writers choose the format by it or add their own.
    temporary = final.with_name(f".{secrets.token_hex(6)}-new{final.suffix[:40]}")
    try:
        yield temporary
        with open(temporary, "r+b") as written:
            os.fsync(written.fileno())
        if final.exists():
            shutil.copymode(final, temporary)
        os.replace(temporary, final)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


@contextmanager
def output(final: str | Path, what: str) -> Iterator[Path]:
    """Yield a temporary path as ``atomic_path`` does, the folder made where it is missing; OutputError where
    that fails.

    ``what`` begins the sentence: "The report".
    """
    final = Path(final)
    try:
        if "\0" in str(final):
            raise OSError("a null byte in its name")
        final.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(final) as temporary:
            yield temporary
    except OSError as error:
        where = f"{shown(str(final), 300)} ({error.strerror or error})"
        raise OutputError(
            f"{what} cannot be written to {where}; choose another folder or file name."
        ) from error
