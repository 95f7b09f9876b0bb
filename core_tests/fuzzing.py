"""Seeded damage for the readers' tests: bytes, words and lines changed at random, and what a reader may do
with it.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from nsm_core.errors import NsmError

WORDS = (
    b"nan", b"inf", b"-inf", b"-1", b"0", b"1e308", b"-1e308", b"1e-300", b"9" * 30, b"9" * 400, b"9" * 5000,
    b"1_0", b"0x10", b"\xc2\xb2", b"\xd9\xa3", b"", b"{", b"}", b"[", b"]", b'"', b"'", b'"x"', b"=", b"true",
    b"[]", b"{}", b"[[]]", b"a.b", b"1,5", b"1.0.0", b"\x00", b"\xff\xfe", b"1979-05-27", b"-0.0",
    b"999999999", b"12.5", b"#", b"\\", b"\r", b"JOINT", b"MOTION", b"End Site", b"null",
    b"-99999999999999999999", b"4294967295",
)  # fmt: skip


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return a copy with one to four changes of bytes, words, lines or blocks."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice((_byte, _word, _word, _word, _line, _block, _cut))(data, rng)
    return data


def _byte(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + bytes((rng.randrange(256),)) + data[at + rng.randrange(2) :]


def _word(data: bytes, rng: random.Random) -> bytes:
    words = data.split(b" ")
    at = rng.randrange(len(words))
    # The last line end of a word stays: it is the line that is damaged, not the lines' count.
    tail = words[at][len(words[at].rstrip()) :]
    words[at] = rng.choice(WORDS) + tail
    return b" ".join(words)


def _line(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[a]
    elif kind == 1:
        lines.insert(b, lines[a])
    elif kind == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        key, sign, _ = lines[a].partition(b"=")
        lines[a] = key + sign + b" " + rng.choice(WORDS)
    return b"\n".join(lines)


def _block(data: bytes, rng: random.Random) -> bytes:
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    b = min(b, a + 400)
    return data[:b] + data[a:b] * rng.choice((1, 3)) + data[b:] if rng.random() < 0.5 else data[:a] + data[b:]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


@contextmanager
def bounded(megabytes: float) -> Iterator[None]:
    """Let this process have so much more memory than now: what asks for more gets a MemoryError.  On Linux
    alone.
    """
    if not sys.platform.startswith("linux"):
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + int(megabytes * 1e6), before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def survives(
    read: Callable[[bytes], None], data: bytes, count: int, seed: int, megabytes: float = 200
) -> tuple[int, int]:
    """Feed ``count`` damaged copies to a reader: it returns, or raises NsmError in one sentence, in bounded
    memory.

    Returns how many were read and how many refused.
    """
    rng, done, refused = random.Random(seed), 0, 0
    read(data)  # whole, and whatever it loads for good
    with bounded(megabytes):
        for k in range(count):
            copy = damaged(data, rng)
            try:
                read(copy)
                done += 1
            except NsmError as error:
                refused += 1
                text = str(error)
                assert text.endswith(".") and "\n" not in text and len(text) < 1200, (seed, k, text)
            except Exception as error:
                raise AssertionError(
                    f"seed {seed}, copy {k}: {type(error).__name__}: {error}\n{copy[:3000]!r}"
                ) from error
    return done, refused


def one_sentence(caught) -> str:
    text = str(caught.value)
    assert "\n" not in text and text.endswith(".") and "Traceback" not in text
    return text
