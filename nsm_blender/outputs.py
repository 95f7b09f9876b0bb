"""Which files a batch may write: nothing of the animator's, no file twice, all of it whole."""

from __future__ import annotations

import os
import unicodedata
from contextlib import suppress
from pathlib import Path

import bpy

from nsm_core.errors import JobError, OutputError
from nsm_core.files import output
from nsm_core.validate import shown

LONGEST_NAME = 255  # bytes, of a file's name on every usual disk


def identities(path: Path) -> set[object]:
    """What tells a file: its path without links, ``..``, and differences of capitals or composed letters, and its place on the disk.

    Where capitals do count, two names that differ in them alone are two files; a batch keeps them apart all the same, since its
    files may go to a disk where they are one.
    """
    real = os.path.normcase(os.path.realpath(path))
    found: set[object] = {unicodedata.normalize("NFC", unicodedata.normalize("NFC", real).casefold())}
    with suppress(OSError, ValueError):  # most are not there yet
        status = os.stat(real)
        found.add((status.st_dev, status.st_ino))
    return found


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file, by any spelling or link."""
    return bool(identities(one) & identities(other))


def files_of_scene() -> set[object]:
    """Identities of the files that the open scene reads: libraries, pictures, sounds and others."""
    return set().union(*(identities(Path(os.fsdecode(path))) for path in bpy.utils.blend_paths(absolute=True)))


def require_name(path: Path, what: str) -> None:
    """Raise JobError on a path that no disk takes; ``what`` is the key and its take in words."""
    if "\0" in str(path):
        raise JobError(f"{what} is {shown(path.name)}, with a null byte in it; give it a plain name.")
    for part in path.parts:
        try:
            size = len(os.fsencode(part))
        except UnicodeError:
            raise JobError(f"{what} is {shown(part)}, with letters that no file name can have; give it a plain name.") from None
        if size > LONGEST_NAME:
            raise JobError(f"{what} has a name of {size} bytes, {shown(part)}; give one of at most {LONGEST_NAME}.")


def save_scene(path: Path, what: str, **how: object) -> None:
    """Save the open scene, whole or not at all; OutputError where that fails, in the words ``what``."""
    with output(path, what) as temporary:
        target = temporary if temporary.suffix == ".blend" else temporary.with_name(temporary.name + ".blend")
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(target), check_existing=False, copy=True, relative_remap=True, **how)
            if target != temporary:
                os.replace(target, temporary)
        except RuntimeError as error:  # Blender's own sentence, with "Error: " before it
            raise OutputError(f"{what} cannot be written to {path} ({_reason(error)}); choose another folder or file name.") from error
        finally:
            for left in (target.with_name(target.name + "@"), *((target,) if target != temporary else ())):
                left.unlink(missing_ok=True)


def _reason(error: RuntimeError) -> str:
    """The end of what Blender says, on one line."""
    lines = [line.strip() for line in str(error).removeprefix("Error: ").splitlines() if line.strip()]
    return lines[-1].rstrip(".") if lines else "Blender gives no reason"
