"""Takes of a job on several machines: shards, and workers of a scheduler of which one is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import bpy
import pytest

from nsm_blender import batch
from nsm_blender.jobs.options import of_shard, read_options, read_shard
from nsm_blender.rigs.character import add_character
from nsm_core.errors import JobError

NAMES = ("a", "b", "c")


def write_job(folder: Path, names: tuple[str, ...] = NAMES) -> Path:
    """A job of short takes, each with a seed of its own."""
    text = 'scene = "room.blend"\n'
    for seed, name in enumerate(names):
        text += (
            f'[[take]]\nname = "{name}"\nseed = {seed}\nreport = "{name}.json"\nbvh = "{name}.bvh"\n'
            'goals = [{ action = "idle", hold = 0.2 }]\n'
        )
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return path


def save_room(folder: Path) -> None:
    add_character((0, 0, 0))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "room.blend"))


class TestShards:
    @pytest.mark.parametrize("count", [1, 2, 3, 7, 12])
    def test_they_are_disjoint_and_together_hold_every_take(self, count):
        takes = [f"take {i}" for i in range(1, 8)]
        shards = [of_shard(takes, (i, count)) for i in range(1, count + 1)]
        assert sorted(entry for shard in shards for entry in shard) == list(enumerate(takes, 1))
        assert max(map(len, shards)) - min(map(len, shards)) <= 1
        assert shards == [of_shard(takes, (i, count)) for i in range(1, count + 1)]

    @pytest.mark.parametrize("text", ["", "1", "0/3", "4/3", "1/0", "-1/3", "1/3/5", "a/b", "1/1e9", "²/3"])
    def test_others_are_refused_in_one_sentence(self, text):
        with pytest.raises(JobError, match="write it as I/N"):
            read_shard(text)

    @pytest.mark.parametrize("arguments", [[], ["a.toml", "b.toml"], ["a.toml", "--shards", "1/2"]])
    def test_a_wrong_call_is_refused_in_one_sentence(self, arguments):
        with pytest.raises(JobError, match="call it as in: batch.py job.toml"):
            read_options(arguments)

    def test_only_its_takes_are_made(self, tmp_path):
        save_room(tmp_path)
        lines: list[str] = []
        assert batch.main([str(write_job(tmp_path)), "--shard", "2/3"], lines.append) == 0
        assert [p.name for p in sorted(tmp_path.glob("*.json"))] == ["b.json"]
        assert lines[-1] == "1 of 1 takes are as asked for."
        assert "worker" not in json.loads((tmp_path / "b.json").read_text())


class Farm:
    """A scheduler and two workers, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        where = ["--scheduler-file", str(self.file), "--no-dashboard"]
        self.scheduler = self._start("dask_scheduler", *where, "--port", "0")
        self.workers = {
            name: self._start("dask_worker", *where, "--nthreads", "1", "--no-nanny", "--name", name)
            for name in ("first", "second")
        }

    def _start(self, what: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.{what}", *arguments]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    @property
    def address(self) -> str:
        for _ in range(600):
            if self.file.exists() and (text := self.file.read_text()):
                return json.loads(text)["address"]
            time.sleep(0.1)
        raise AssertionError("the scheduler did not start")

    def close(self) -> None:
        for process in (*self.workers.values(), self.scheduler):
            process.kill()
            process.wait()


@pytest.mark.skipif(not bpy.app.module, reason="the application has no Python with bpy for workers to start")
@pytest.mark.skipif(os.name == "nt", reason="a process is killed by a signal")
class TestScheduler:
    @pytest.fixture
    def farm(self, tmp_path):
        pytest.importorskip("distributed", reason="runs where studios have it")
        farm = Farm(tmp_path)
        yield farm
        farm.close()

    def test_takes_of_a_killed_worker_run_again_and_none_is_lost_or_doubled(self, tmp_path, farm):
        save_room(tmp_path)
        job, lines = write_job(tmp_path), []

        def say(line: str) -> None:
            lines.append(line)
            if line.endswith("begun by first"):
                farm.workers["first"].send_signal(signal.SIGKILL)  # a moment into its first take

        assert batch.main([str(job), "--scheduler", farm.address], say) == 0, lines
        again = [line for line in lines if line.endswith("again: first was lost")]
        begun = [line for line in lines if "begun by" in line]
        assert len(again) == 1 and len(begun) == len(NAMES) + 1, lines
        assert lines[-1] == "3 of 3 takes are as asked for."
        for name in NAMES:
            report = json.loads((tmp_path / f"{name}.json").read_text())
            assert report["name"] == name and report["worker"] == "second" and "error" not in report
        made = {p.name for p in tmp_path.iterdir()} - {"room.blend", "job.toml", "scheduler.json"}
        assert {name for name in made if not name.startswith(".")} == {
            f"{name}{ending}" for name in NAMES for ending in (".json", ".bvh")
        }
        # What a worker has made is what is made here.
        there = (tmp_path / "c.bvh").read_text()
        assert batch.main([str(job), "--shard", "3/3"], lines.append) == 0
        assert (tmp_path / "c.bvh").read_text() == there

    def test_a_process_ends_with_its_worker(self, tmp_path):
        script = "import time; from nsm_blender.jobs.farm import end_with_worker as e; e(); time.sleep(60)"
        process = subprocess.Popen(
            [sys.executable, "-c", script], stdin=subprocess.PIPE, cwd=Path(__file__).resolve().parents[2]
        )
        process.stdin.close()
        assert process.wait(timeout=50) == 3

    def test_nobody_there_is_told_in_one_sentence(self, tmp_path, monkeypatch):
        pytest.importorskip("distributed", reason="runs where studios have it")
        monkeypatch.setattr("nsm_blender.jobs.farm._ANSWER_WITHIN", 0.5)
        lines: list[str] = []
        assert batch.main([str(write_job(tmp_path)), "--scheduler", "tcp://127.0.0.1:9"], lines.append) == 2
        assert len(lines) == 1 and "No scheduler answers at tcp://127.0.0.1:9" in lines[0]
