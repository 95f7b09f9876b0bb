"""Batch jobs on full and locked disks, and jobs in which something raises."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from flow import Rooms, again, growing_by
from injected import ERRORS, counted, injected

from nsm_blender import batch
from nsm_blender.pictures.outputs import blend_is_whole, mp4_is_whole, png_is_whole

OUTPUTS = {"out": "take.blend", "bvh": "take.bvh", "report": "take.json", "sheet": "take.png"}
_SIZES = {
    "out": (0, 1000, 60_000, 250_000),
    "bvh": (0, 1000, 20_000),
    "report": (0, 200),
    "sheet": (0, 2000, 20_000),
}


def disk_cases(rooms: Rooms) -> Iterator[tuple[str, Callable[[], tuple[str, list[str]]]]]:
    """Names and runs of all cases."""
    for key, sizes in _SIZES.items():
        for size in sizes:
            for old in (False, True):
                name = f"'{key}', no room after {size} bytes" + (", over an older file" if old else "")
                yield name, lambda k=key, s=size, o=old: _job(rooms, k, o, lambda _: _small_files(s))
        yield f"'{key}', a disk that is full", lambda k=key: _job(rooms, k, False, _full_disk)
        yield f"'{key}', a folder that is read-only", lambda k=key: _job(rooms, k, False, _locked_folder)
        yield f"'{key}', over a read-only file", lambda k=key: _job(rooms, k, True, _locked_folder)
    folder = _laid_out(rooms, "out", False)
    with growing_by(again(rooms.motion("carry"))), counted() as calls:
        batch.main([str(folder / "job.toml")], lambda _: None)
    steps = [
        k
        for k in calls
        if k[0].startswith(
            ("nsm_blender/batch", "nsm_blender/jobs", "nsm_blender/pictures", "nsm_core/files")
        )
    ]
    for number, (file, name) in enumerate(steps):
        error = ERRORS[number % (len(ERRORS) - 1)]  # all but a break, which ends a batch
        title = f"a job, {type(error).__name__} in {file[:-3]}.{name}"
        yield (
            title,
            lambda p=(file, name, 1), e=error: _job(
                rooms, "out", True, lambda _: injected(p, e), raised=True
            ),
        )


def _laid_out(rooms: Rooms, key: str, old: bool) -> Path:
    """A folder with a job of two takes: the first writes ``key``, the second a report."""
    folder = rooms.folder / "job"
    if folder.exists():
        shutil.rmtree(folder)
    (folder / "results").mkdir(parents=True)
    shutil.copy(rooms.file("carry"), folder / "room.blend")
    goal = 'goals = [ { object = "Box", action = "carry", to = "Table", hold = 0.1 } ]'
    (folder / "job.toml").write_text(
        'scene = "room.blend"\n'
        f'[[take]]\nname = "one"\ncharacter = "Hero"\n{goal}\n{key} = "results/{OUTPUTS[key]}"\n'
        f'[[take]]\nname = "two"\ncharacter = "Hero"\n{goal}\nreport = "two.json"\n'
    )
    if old:
        (folder / "results" / OUTPUTS[key]).write_bytes(b"what was there before")
    return folder


def _job(rooms: Rooms, key: str, old: bool, fault, raised: bool = False) -> tuple[str, list[str]]:
    motion = rooms.motion("carry")
    folder = _laid_out(rooms, key, old)
    lines: list[str] = []
    scene = (folder / "room.blend").read_bytes()
    with growing_by(again(motion)), fault(folder) as told:
        try:
            code = batch.main([str(folder / "job.toml")], lines.append)
        except Exception as error:  # before the first take: the command ends with it
            code, lines = 1, [f"Error: {error}"]
    wrong = []
    result = folder / "results" / OUTPUTS[key]
    there = result.read_bytes() if result.exists() else b""
    state = "as before" if there == (b"what was there before" if old else b"") else "the whole take"
    if state != "as before" and not _whole(key, result):
        wrong.append(f"{result.name} is neither whole nor as it was")
    if scene != (folder / "room.blend").read_bytes():
        wrong.append("the input scene has changed")
    if [p for p in result.parent.iterdir() if p != result]:
        wrong.append(f"left over: {sorted(p.name for p in result.parent.iterdir())}")
    if code == 0 and state == "as before":
        wrong.append("the exit code is 0 and nothing was written")
    if not raised and (
        code != 1 or not any("cannot be written" in line or "Error" in line for line in lines)
    ):
        wrong.append(f"nobody was told: {lines}")
    if raised and not told:
        wrong.append("nothing was raised")
    if not raised and not isinstance(told, str) and "1 of 2" not in lines[-1]:
        wrong.append(f"the other take was lost: {lines[-1]}")
    return state, wrong


def _whole(key: str, path: Path) -> bool:
    if key == "report":
        import json

        return bool(json.loads(path.read_text()))
    if key == "bvh":
        lines = path.read_text().splitlines()
        return (
            int(next(x for x in lines if x.startswith("Frames:")).split()[1])
            == len(lines) - lines.index("MOTION") - 3
        )
    return {"out": blend_is_whole, "sheet": png_is_whole, "video": mp4_is_whole}[key](path)


@contextlib.contextmanager
def _small_files(size: int):
    """No file may grow beyond ``size`` bytes, the other take's report neither."""
    import resource

    handled, before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield "all files"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handled)


@contextlib.contextmanager
def _full_disk(folder: Path):
    """The results lie on a disk of their own without room; a limit on files where none may be made."""
    target = folder / "results"
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", target], capture_output=True)
    if mounted.returncode:
        with _small_files(100):
            yield "no disk of its own"
        return
    try:
        (target / "filler").write_bytes(b"0" * 16384)
        yield None
    finally:
        (target / "filler").unlink()
        left = sorted(target.iterdir())
        subprocess.run(["umount", target], check=True)
        assert not left, left


@contextlib.contextmanager
def _locked_folder(folder: Path):
    """Nobody may write into the folder of the results, nor over what is there."""
    target = folder / "results"
    for each in (*target.iterdir(), target):
        each.chmod(0o555)
    for each in (folder, *folder.parents):  # pytest's own folders let nobody else in
        if each.stat().st_uid == os.geteuid() and each.is_relative_to(tempfile.gettempdir()):
            each.chmod(each.stat().st_mode | 0o755)
    folder.chmod(0o777)  # the other take's report is written here
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    try:
        yield None
    finally:
        if root:
            os.seteuid(0)
        target.chmod(0o755)
