"""Write results whole or not at all: beside their final names, looked at, then renamed."""

from __future__ import annotations

import errno
import io
import json
import os
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, TextIO

import bpy

from nsm_core.errors import OutputError
from nsm_core.files import atomic_path

from .studio import quiet

PICTURE, FILM = ".png", ".mp4"


def with_ending(path: Path, ending: str) -> Path:
    """Return ``path`` with ``ending`` added where it has another one."""
    return path if path.suffix.lower() == ending else path.with_name(path.name + ending)


def require_writable(path: str | Path, ending: str = "", what: str = "") -> Path:
    """Return ``path`` with ``ending``, its folder made; OutputError, about ``what``, where a file cannot be
    written there.

    Nothing is left in the folder, and a file that is there stays as it is.
    """
    path = Path(bpy.path.abspath(str(path))).absolute()
    if ending:
        path = with_ending(path, ending)
    with _told(path, what):
        final = Path(os.path.realpath(path))
        final.parent.mkdir(parents=True, exist_ok=True)
        if final.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        try:
            os.lstat(final)  # a name that is too long for the disk is found here
        except FileNotFoundError:
            pass
        else:
            with final.open("ab"):  # a file that is locked or protected is not replaced either
                pass
        if final.is_file() or not final.exists():
            with tempfile.TemporaryFile(dir=final.parent):
                pass
    return path


@contextmanager
def written(path: Path, what: str, is_whole: Callable[[Path], bool] | None = None) -> Iterator[Path]:
    """Yield a temporary path that takes the place of ``path`` at the end, if the file there ``is_whole``.

    Blender's own writers do not always say that a disk was full, hence the look at what they left.  Raises
    OutputError about ``what``; the old file, if any, is then still there.
    """
    with _told(path, what), atomic_path(path) as temporary:
        if is_whole and temporary == Path(os.path.realpath(path)):
            raise OSError(errno.EINVAL, "it is no file")  # a device: Blender would put a file in its place
        try:
            yield temporary
        except RuntimeError as problem:  # what an operator reports
            reason = str(problem).removeprefix("Error: ").strip().splitlines() or ["no reason given"]
            raise OSError(
                errno.EIO, f"Blender says: {reason[0]}".replace(str(temporary), path.name)
            ) from problem
        if is_whole and not is_whole(temporary):
            raise OSError(errno.ENOSPC, "it was cut short; the disk may be full")


def write_json(path: Path, data: Any, what: str = "The report") -> None:
    """Write a report; OutputError when that fails."""
    text = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    with written(path, what) as temporary:
        temporary.write_bytes(text.encode("utf-8", errors="replace"))


def save_blend(path: Path, what: str = "The scene", compress: bool = False) -> None:
    """Save the open scene as a copy; OutputError when that fails."""
    with (
        written(path, what, blend_is_whole) as temporary,
        quiet(),
        redirect_stdout(_Renaming(sys.stdout, temporary.name, path.name)),
    ):
        bpy.ops.wm.save_as_mainfile(
            filepath=str(temporary), copy=True, relative_remap=True, compress=compress
        )


class _Renaming(io.TextIOBase):
    """Passes on what is printed, with the name that a file will have for the passing one: Blender says where
    it has saved.
    """

    def __init__(self, stream: TextIO, passing: str, final: str) -> None:
        self._stream, self._passing, self._final = stream, passing, final

    def write(self, text: str) -> int:
        self._stream.write(text.replace(self._passing, self._final))
        return len(text)

    def flush(self) -> None:
        self._stream.flush()


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a temporary folder; OutputError where none can be made."""
    try:
        folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
    except OSError as problem:
        raise OutputError(
            f"No temporary folder can be made ({problem.strerror}); make room on that disk."
        ) from problem
    with folder as name:
        yield Path(name)


def blend_is_whole(path: Path) -> bool:
    """Whether a .blend, plain or compressed, reaches to its end."""
    with path.open("rb") as file:
        start = file.read(9)
        file.seek(max(0, path.stat().st_size - 32))
        end = file.read()
    # The last block is ENDB: a head alone, of 32 bytes from 5.0 on, whose files have a digit here.
    if start.startswith(b"BLENDER"):
        return end[0 if start[7:].isdigit() else 8 :].startswith(b"ENDB")
    # Compressed: Zstandard frames with a table of them at the end, which has a magic number of its own.
    return start.startswith(b"\x28\xb5\x2f\xfd") and end.endswith(b"\xb1\xea\x92\x8f")


def png_is_whole(path: Path) -> bool:
    """Whether every chunk of a PNG is there, with its right checksum, to the last one."""
    if not path.is_file():
        return False
    data = memoryview(path.read_bytes())
    at, kind = 8, b""
    while bytes(data[:8]) == b"\x89PNG\r\n\x1a\n" and kind != b"IEND":
        length, kind = int.from_bytes(data[at : at + 4], "big"), bytes(data[at + 4 : at + 8])
        check = data[at + 8 + length : at + 12 + length]
        if len(check) < 4 or zlib.crc32(data[at + 4 : at + 8 + length]) != int.from_bytes(check, "big"):
            return False
        at += 12 + length
    return kind == b"IEND"


def mp4_is_whole(path: Path) -> bool:
    """Whether the boxes of an MP4 fill it exactly, its index among them: the encoder writes that last."""
    if not path.is_file():
        return False
    at, size, kinds = 0, path.stat().st_size, set()
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            head = file.read(16)
            length = int.from_bytes(head[:4], "big")
            length = int.from_bytes(head[8:16], "big") if length == 1 else length or size - at
            if length < 8:
                return False
            kinds.add(head[4:8])
            at += length
    return at == size and {b"ftyp", b"mdat", b"moov"} <= kinds


@contextmanager
def _told(path: Path, what: str) -> Iterator[None]:
    """Turn what the system says into a sentence."""
    try:
        yield
    except (OSError, ValueError) as problem:  # a null byte in a path is a ValueError
        reason = getattr(problem, "strerror", None) or str(problem)
        subject = f"{what} cannot be written to {path}" if what else f"{path} cannot be written"
        full = getattr(problem, "errno", 0) == errno.ENOSPC
        advice = "make room there, or choose another folder" if full else "choose another folder or file name"
        raise OutputError(f"{subject} ({reason}); {advice}.") from problem
