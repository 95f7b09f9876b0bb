"""The command line of the batch: a job file, which of its takes, and where they are made."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn, TypeVar

from nsm_core.errors import JobError

Item = TypeVar("Item")


@dataclass(frozen=True)
class Options:
    """What was asked for on the command line."""

    job: str
    shard: tuple[int, int] = (1, 1)  # number of the shard, from 1, and how many there are
    scheduler: str = ""
    worker: str = ""  # who makes the takes, for their reports; named where a scheduler has sent them


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise JobError(f"The batch was called wrongly ({message}); call it as in: batch.py job.toml")


def read_options(arguments: Sequence[str]) -> Options:
    """Read the arguments after ``--``; JobError where they are of no use."""
    parser = _Parser(prog="batch.py", description="Make the takes of a job file.")
    parser.add_argument("job", help="the job file (docs/batch.md)")
    parser.add_argument(
        "--shard", default="1/1", metavar="I/N", help="make every N-th take only, beginning with the I-th"
    )
    parser.add_argument(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="have the workers of a dask scheduler make the takes",
    )
    parser.add_argument("--worker", default="", help=argparse.SUPPRESS)
    found = parser.parse_args(list(arguments))
    return Options(found.job, read_shard(found.shard), found.scheduler, found.worker)


def read_shard(text: str) -> tuple[int, int]:
    """Read "2/5" as (2, 5); JobError where it is no such thing."""
    number, slash, count = text.partition("/")
    if slash and all(part.isascii() and part.isdigit() and len(part) < 10 for part in (number, count)):
        if 1 <= int(number) <= int(count):
            return int(number), int(count)
    raise JobError(f"The shard '{text}' is none; write it as I/N with I from 1 to N, such as --shard 2/5.")


def of_shard(takes: Sequence[Item], shard: tuple[int, int]) -> list[tuple[int, Item]]:
    """The takes of a shard with their numbers in the job, from 1: the I-th take and every N-th after it.

    All shards together hold every take once, also where there are more shards than takes.
    """
    number, count = shard
    return [(i, take) for i, take in enumerate(takes, 1) if (i - number) % count == 0]
