"""The takes of a job on the workers of a dask scheduler: each in a Blender of its own, again where one was
lost.

A worker starts the batch as another process, for that one take.  It needs neither the add-on nor Blender in
its own Python, and a Blender that crashes takes no worker with it.  When a worker is killed, the process that
it has started notices and ends before it writes anything; the scheduler gives the take to another one.
"""

from __future__ import annotations

import os
import secrets
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy

from nsm_core.errors import JobError

from .job import Job, JobTake

_ANSWER_WITHIN = 20.0  # seconds for a scheduler to answer
_TRIES = 2  # more of a take whose Blender crashed


def run_on(
    address: str,
    job: Job,
    takes: Sequence[tuple[int, JobTake]],
    say: Callable[[str], None],
    broken: Callable[[JobTake, str], None],
) -> int:
    """Have the workers of the scheduler at ``address`` make numbered takes; return how many failed.

    Scene, outputs and the add-on must have the same paths on all machines.  ``broken`` is told a take that no
    worker could finish, and why.  Raises JobError where dask is missing or no scheduler answers.
    """
    try:
        import distributed
    except ImportError as error:
        raise JobError(
            "A scheduler needs the Python package distributed, which is not installed here; install it "
            "(pip install distributed), or leave --scheduler away."
        ) from error
    try:
        client = distributed.Client(address, timeout=_ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise JobError(
            f"No scheduler answers at {address}; start one with `dask scheduler` and give the address that "
            "it prints, such as tcp://10.0.0.5:8786."
        ) from error
    begun: dict[int, str] = {}

    def tell(event: tuple[float, dict[str, Any]]) -> None:
        number, worker = event[1]["take"], event[1]["by"]
        again = f", again: {begun[number]} was lost" if begun.get(number, worker) != worker else ""
        begun[number] = worker
        say(f"[{number}/{len(job.takes)}] {job.takes[number - 1].name}: begun by {worker}{again}")

    with client, client.as_current():
        if not client.scheduler_info()["workers"]:
            say(f"Waiting for workers; start some with `dask worker {address} --nthreads 1`.")
        mark = f"nsm-{secrets.token_hex(6)}"  # of this run, since others may use the scheduler too
        client.subscribe_topic(mark, tell)
        make, (command, script) = _make(), _command()
        futures = {}
        for number, take in takes:
            # The I-th of as many shards as there are takes is the I-th take alone.
            arguments = [str(job.path), "--shard", f"{number}/{len(job.takes)}"]
            key = f"{mark}-{number}"
            future = client.submit(
                make, command, script, arguments, number, mark, key=key, pure=False, retries=_TRIES
            )
            futures[future] = take
        failed = 0
        for future in distributed.as_completed(futures):
            if future.status == "finished":
                code, lines = future.result()
                for line in lines:
                    say(line)
                failed += code != 0
            else:
                failed += 1
                broken(futures[future], f"no worker could finish it ({future.exception()})")
        client.unsubscribe_topic(mark)
    return failed


def _command() -> tuple[list[str], str]:
    """How the batch is started on this machine, up to its own arguments, and where its script lies."""
    script = str(Path(__file__).resolve().parent.parent / "batch.py")
    if bpy.app.binary_path:
        return [bpy.app.binary_path, "--background", "--python", script, "--"], script
    return [sys.executable, script], script


def _make() -> Callable[..., tuple[int, list[str]]]:
    """What a worker does: the exit code and the lines of one take.

    It is sent by value, being no module's: workers need not find the add-on.
    """

    def make(
        command: list[str], script: str, arguments: list[str], number: int, mark: str
    ) -> tuple[int, list[str]]:
        import os
        import subprocess

        from distributed import get_worker

        worker = get_worker()
        if "NSM_BLENDER" in os.environ:  # this machine's own
            command = [os.environ["NSM_BLENDER"], "--background", "--python", script, "--"]
        worker.log_event(mark, {"take": number, "by": str(worker.name)})
        process = subprocess.Popen(
            [*command, *arguments, "--worker", str(worker.name)],
            stdin=subprocess.PIPE,  # stays open as long as this worker lives
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
        )
        lines = process.stdout.read().splitlines() if process.stdout else []
        if process.wait() not in (0, 1):
            raise RuntimeError(f"Blender ended with code {process.returncode}: {' / '.join(lines[-3:])}")
        return process.returncode, [line for line in lines if line.startswith(f"[{number}/")]

    return make


def end_with_worker() -> None:
    """End this process at once when the worker that has started it is no more: its end of our input is then
    closed.  What was not renamed to its final name by then never will be.
    """

    def wait() -> None:
        while sys.stdin.buffer.read(1):
            pass
        os._exit(3)

    threading.Thread(target=wait, daemon=True).start()
