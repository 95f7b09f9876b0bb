"""What entries of a job file share: known keys, needed ones, flags, words and bone maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nsm_core import validate
from nsm_core.errors import JobError

from .job import JobTake
from .paths import require_path, require_words

# Blender's first frame, and one that leaves its last 48,574 to the take.
FIRST_FRAME, LAST_START = -1_048_574, 1_000_000
LARGEST_SEED = 2**31 - 1


def known(entry: dict[str, Any], keys: tuple[str, ...], where: str) -> None:
    """Raise JobError where an entry has other keys."""
    for key in entry:
        if key not in keys:
            raise JobError(
                f"The key {validate.shown(key)} in {where} is unknown; the keys are {', '.join(keys)}."
            )


def needed(entry: dict[str, Any], key: str, where: str) -> Any:
    """A value that must be there; JobError where it is not."""
    if key not in entry:
        raise JobError(f"The key '{key}' is missing in {where}; add it.")
    return entry[key]


def flag(entry: dict[str, Any], key: str, where: str, default: bool) -> bool:
    """A value that is true or false; JobError where it is neither."""
    value = entry.get(key, default)
    if not isinstance(value, bool):
        raise JobError(f"'{key}' in {where} is {validate.shown(value)}; it must be true or false.")
    return value


def one_of(entry: dict[str, Any], key: str, where: str, words: tuple[str, ...]) -> str:
    """One of some words, the first where the entry has none."""
    found = entry.get(key, words[0])
    if found not in words:
        listed = ", ".join(f'"{word}"' for word in words[:-1])
        raise JobError(
            f"'{key}' in {where} is {validate.shown(found)}; it must be {listed} or \"{words[-1]}\"."
        )
    return found


def rig(entry: dict[str, Any], where: str, folder: Path) -> str | Path:
    """The bone map that an entry asks for: a file where it ends as one, else the name of a preset."""
    if "rig" not in entry:
        return ""
    words = require_words(entry["rig"], f"'rig' in {where}")
    return require_path(words, f"'rig' in {where}", folder) if words.lower().endswith(".toml") else words


def frame(value: Any, what: str) -> float:
    """A frame of the scene, whole or between two of them."""
    read = validate.number if isinstance(value, float) else validate.whole
    return read(value, what, JobError, FIRST_FRAME, LAST_START)


def read_actor(take: JobTake, entry: dict[str, Any], where: str, folder: Path) -> None:
    """Read into ``take`` who acts: character, bone map and seed."""
    take.character = require_words(entry.get("character", take.character), f"'character' in {where}")
    take.rig = rig(entry, where, folder)
    take.seed = validate.whole(entry.get("seed", take.seed), f"'seed' in {where}", JobError, 0, LARGEST_SEED)


def begun(
    take: JobTake, entry: Any, what: str, outputs: tuple[str, ...], folder: Path
) -> tuple[str, JobError | None]:
    """Read name and outputs of an entry into ``take``, before all else, so that whatever is wrong can be
    reported there: what to call it in sentences, and what is wrong with an output.
    """
    validate.table(entry, take.name, JobError)
    name = entry.get("name")
    if isinstance(name, str) and name.isprintable() and name.strip():
        take.name = name if len(name) <= 80 else name[:77] + "..."
    where, wrong = f"{what} '{take.name}'", None
    for key in outputs:
        try:
            if key in entry:
                take.outputs[key] = require_path(entry[key], f"'{key}' in {where}", folder, key)
        except JobError as error:
            wrong = wrong or error
    return where, wrong
