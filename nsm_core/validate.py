"""What others wrote, checked before anything is allocated or computed of it: encodings, types, sizes and
finiteness.

Every function takes the error to raise and, as ``what``, the words for the place in the file: "walk.nsm.toml,
goal 2: ahead".
"""

from __future__ import annotations

import csv
import math
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .errors import NsmError

MOST_TEXT = 1 << 30  # bytes of a text file
_MARKS = (
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)


def read_bytes(
    path: Path, error: type[NsmError], advice: str = "check the path", most: int = MOST_TEXT
) -> bytes:
    """Read a file of at most ``most`` bytes."""
    try:
        if path.exists() and not path.is_file():  # a folder, or a pipe that never ends
            raise error(f"{path.name} cannot be read (it is no file); {advice}.")
        if path.exists() and path.stat().st_size > most:
            raise error(
                f"{path.name} holds {path.stat().st_size / 1e6:.0f} MB, more than {most / 1e6:.0f} MB; "
                f"{advice}."
            )
        return path.read_bytes()
    except (OSError, ValueError) as problem:  # a null byte in a path is a ValueError
        reason = getattr(problem, "strerror", None) or str(problem)
        raise error(f"{path.name} cannot be read ({reason}); {advice}.") from problem


def read_text(
    path: Path, error: type[NsmError], advice: str = "check the path", most: int = MOST_TEXT
) -> str:
    """Read a text of any usual encoding: by its byte order mark, else UTF-8 or UTF-16 by where its zeros are,
    else Latin-1.
    """
    data = read_bytes(path, error, advice, most)
    return decoded(data)


def decoded(data: bytes) -> str:
    """Text of bytes, without marks before it or behind it; what is no text at all comes out as letters
    without sense.
    """
    # Marks that two programs have set, letters without width that are copied along from web pages, the end of
    # a text under DOS.
    return _letters(data).lstrip("\ufeff\u200b\u2060").rstrip("\x1a")


def _letters(data: bytes) -> str:
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return data.decode(encoding, errors="replace")
    start = data[:4096]
    if start.count(0) > len(start) // 4:  # plain letters of UTF-16 are every other byte zero
        high = start[0::2].count(0) > start[1::2].count(0)
        return data.decode("utf-16-be" if high else "utf-16-le", errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def plain_line_ends(text: str) -> str:
    """Text whose lines end in a line feed alone: doubled and old carriage returns count as one line end."""
    return re.sub(r"\r+\n?", "\n", text)


def read_toml(
    path: Path, error: type[NsmError], advice: str = "check the path", mend: str = "correct that line"
) -> dict[str, Any]:
    """Read a TOML file, with a byte order mark or without."""
    try:
        return tomllib.loads(plain_line_ends(read_text(path, error, advice, most=1 << 26)))
    except RecursionError as problem:
        raise error(
            f"{path.name} is not valid TOML: brackets within brackets without end; {mend}."
        ) from problem
    except ValueError as problem:  # TOMLDecodeError is one, and so are numbers of thousands of digits
        raise error(f"{path.name} is not valid TOML: {problem}; {mend}.") from problem


def read_csv(path: Path, error: type[NsmError], columns: Iterable[str], mend: str) -> list[dict[str, str]]:
    """Read the rows of a table by its header, parted by commas, semicolons or tabs; missing cells are
    empty.
    """
    lines = plain_line_ends(read_text(path, error, most=1 << 26)).split("\n")
    head = next((line for line in lines if line.strip()), "")
    try:
        rows = list(
            csv.reader((line for line in lines if line.strip()), delimiter=max(",;\t", key=head.count))
        )
    except csv.Error as problem:
        raise error(f"{path} is no table ({problem}); {mend}.") from problem
    names = [name.strip().lower() for name in rows[0]] if rows else []
    if len(rows) < 2 or not set(columns) <= set(names):
        raise error(f"{path} lacks the columns {' and '.join(columns)}; {mend}.")
    return [
        dict(zip(names, [*(cell.strip() for cell in row), *[""] * len(names)], strict=False))
        for row in rows[1:]
    ]


def shown(value: object, most: int = 40) -> str:
    """A value as it may stand in a sentence: short, on one line."""
    try:
        text = str(value).lower() if isinstance(value, bool) else repr(value)
    except (ValueError, RecursionError):  # integers of thousands of digits have no text
        text = "a number of thousands of digits" if isinstance(value, int) else f"a {type(value).__name__}"
    return text if len(text) <= most else text[: most - 3] + "..."


def is_number(value: object, low: float = -math.inf, high: float = math.inf) -> bool:
    """Whether a value is a finite number from ``low`` to ``high``; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value)) and low <= value <= high
    except OverflowError:  # an integer that no float holds
        return False


def number(
    value: object, what: str, error: type[NsmError], low: float = -math.inf, high: float = math.inf
) -> float:
    """Return a finite number from ``low`` to ``high``."""
    if not is_number(value, low, high):
        bounds = "a number" if math.isinf(low) and math.isinf(high) else f"a number from {low:g} to {high:g}"
        raise error(f"{what} is {shown(value)}; it must be {bounds}.")
    return float(value)  # type: ignore[arg-type]


def whole(value: object, what: str, error: type[NsmError], low: int, high: int) -> int:
    """Return a whole number from ``low`` to ``high``."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise error(f"{what} is {shown(value)}; it must be a whole number from {low} to {high}.")
    return value


def text(value: object, what: str, error: type[NsmError]) -> str:
    """Return a text in quotes."""
    if not isinstance(value, str):
        raise error(f"{what} is {shown(value)}; it must be a text in quotes.")
    return value


def table(
    value: object, what: str, error: type[NsmError], known: Iterable[str] | None = None
) -> dict[str, Any]:
    """Return a table whose keys are all among ``known``."""
    if not isinstance(value, dict):
        raise error(f"{what} is {shown(value)}; it must be a table of lines such as `name = value`.")
    if known is not None:
        names = list(known)
        for key in value:
            if key not in names:
                raise error(f"{what}: {shown(key)} is not known; use {', '.join(names)}.")
    return value


def listed(value: object, what: str, error: type[NsmError], most: int = 100_000) -> list[Any]:
    """Return a list of at most ``most`` entries."""
    if not isinstance(value, list):
        raise error(f"{what} is {shown(value)}; it must be a list in square brackets.")
    if len(value) > most:
        raise error(f"{what} has {len(value)} entries; it may have {most}.")
    return value
