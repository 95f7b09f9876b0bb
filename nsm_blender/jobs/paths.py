"""Paths in job files: names that a disk takes, and files that must not be written over."""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Hashable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nsm_core import validate
from nsm_core.errors import JobError

from ..pictures.outputs import FILM, PICTURE, with_ending

if TYPE_CHECKING:
    from .job import JobTake

# Blender keeps paths of 1023 bytes and cuts longer ones; disks take names of 255.
_LONGEST_PATH, _LONGEST_NAME = 1000, 255
_ENDINGS = {"sheet": PICTURE, "video": FILM, "glb": ".glb"}
_OTHERS = {".blend", ".toml", ".json", ".bvh"}  # endings of what a job reads or writes elsewhere


def require_words(value: Any, what: str, most: int = 255) -> str:
    """Return a text of one line that says something; JobError otherwise."""
    words = validate.text(value, what, JobError)
    if not words.strip() or len(words) > most or not words.isprintable():
        raise JobError(
            f"{what} is {validate.shown(value)}; it must be a text of 1 to {most} letters on one line."
        )
    return words


def require_path(value: Any, what: str, folder: Path, key: str = "") -> Path:
    """Return a path of a job file, relative to ``folder``, with the ending of its ``key``; JobError where no
    disk takes it.
    """
    words = require_words(value, what, most=100_000)  # their length is told below
    if words.startswith("//"):
        raise JobError(
            f"{what} is {validate.shown(value)}; paths are relative to the job file: leave '//' away."
        )
    path = folder / words
    if key in _ENDINGS and path.suffix.lower() in _OTHERS:
        raise JobError(
            f"{what} is {validate.shown(value)}; it is written as {_ENDINGS[key]}: end its name so."
        )
    if key in _ENDINGS:
        path = with_ending(path, _ENDINGS[key]) if path.name else path
    longest = max((len(os.fsencode(part)) for part in path.parts), default=0)
    if longest > _LONGEST_NAME or len(os.fsencode(path)) > _LONGEST_PATH:
        raise JobError(
            f"{what} is {validate.shown(value)}, which is too long; names may have {_LONGEST_NAME} bytes "
            "and "
            f"whole paths {_LONGEST_PATH}: give a shorter one."
        )
    return path


def same_file_keys(path: Path) -> set[Hashable]:
    """What two paths share where they lead to one file: by links, other spellings, or capitals, which many
    disks ignore.
    """
    real = Path(os.path.realpath(path))
    keys: set[Hashable] = set()
    name = unicodedata.normalize("NFC", real.name).casefold().rstrip(" .")
    try:
        parent = real.parent.stat()
        keys.add((parent.st_dev, parent.st_ino, name))
    except OSError:  # not made yet
        keys.add((unicodedata.normalize("NFC", str(real.parent)).casefold(), name))
    try:
        file = real.stat()
        keys.add((file.st_dev, file.st_ino))
    except OSError:
        pass
    return keys


def refuse_clashes(job_file: Path, scene: Path, takes: Iterable[JobTake]) -> None:
    """Mark takes that would write over the scene, the job file, a file of an earlier take, or their own.

    Of two takes with one output the later one is refused; an output that is refused is taken out, so that
    nothing writes it.
    """
    job_keys, scene_keys = same_file_keys(job_file), same_file_keys(scene)
    seen: dict[Hashable, str] = {}
    for take in takes:
        for key, path in list(take.outputs.items()):
            keys = same_file_keys(path)
            earlier = next((seen[k] for k in keys if k in seen), None)
            if keys & job_keys:
                problem = f"'{key}' is the job file itself; give it another name."
            elif keys & scene_keys and not (key == "out" and take.overwrite):
                also = ", or say `overwrite = true` in the take" if key == "out" else ""
                problem = f"'{key}' is the scene of the job, which would be lost; give it another name{also}."
            elif earlier:
                problem = f"'{key}' is the same file as {earlier}; give each output its own."
            else:
                seen |= dict.fromkeys(keys, f"'{key}' of take '{take.name}'")
                continue
            take.error = take.error or f"In take '{take.name}', {problem}"
            del take.outputs[key]


def refuse_used(take: JobTake, used: Iterable[str]) -> None:
    """Raise JobError where an output is one of the files that the open scene is made of: libraries, pictures,
    sounds.
    """
    theirs = {key: name for name in used if name for key in same_file_keys(Path(name))}
    for key, path in take.outputs.items():
        name = next((theirs[k] for k in same_file_keys(path) if k in theirs), None)
        if name and key != "report":
            raise JobError(
                f"In take '{take.name}', '{key}' is {Path(name).name}, which the scene uses; give it "
                "another name."
            )
