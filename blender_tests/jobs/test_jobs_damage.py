"""Jobs with wrong values, files that must not be lost, and disks that are full."""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from scenes import empty

from nsm_blender import batch
from nsm_blender.jobs.job import Job
from nsm_blender.jobs.read import read_job
from nsm_blender.pictures import outputs, render
from nsm_blender.rigs.character import add_character
from nsm_core.errors import JobError, NsmError, OutputError

IDLE = "[{ action = 'idle', hold = 0.0 }]"
GOOD = """scene = "room.blend"
[[take]]
name = "one"
character = "Character"
seed = 3
start_frame = 10
contact_ik = true
out = "made/one.blend"
report = "one.json"
sheet = "one.png"
goals = [{ object = "Chair", action = "sit", hold = 2.5 }, { action = "walk", location = [1.0, 2, 0.5] }]
[[take]]
name = "two"
goals = [{ object = "Box", action = "carry", to = "Table" }]
"""


def take(body: str, name: str = "one", goals: str = IDLE) -> str:
    return f'[[take]]\nname = "{name}"\ngoals = {goals}\n{body}\n'


def write_job(folder: Path, text: str) -> Path:
    path = folder / "job.toml"
    path.write_text('scene = "room.blend"\n' + text, encoding="utf-8")
    return path


def run(path: Path) -> tuple[int, list[str]]:
    lines: list[str] = []
    return batch.main([str(path)], lines.append), lines


@pytest.fixture
def room(tmp_path) -> Path:
    add_character((0, 0, 0))
    empty("Mark", (1.5, 0.5, 0))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    return tmp_path


@contextlib.contextmanager
def small_files(size: int):
    """No file may grow beyond ``size`` bytes, as on a full disk; only inside, since pytest's own output may
    go to a larger file.
    """
    resource = pytest.importorskip("resource")
    handled, before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handled)


class TestNothingIsWrittenOver:
    @pytest.mark.parametrize("key", ["out", "report", "bvh"])
    @pytest.mark.parametrize(
        "name",
        ["room.blend", "sub/../room.blend", "./link.blend", "folder/room.blend", "Room.BLEND", "JOB.toml"],
    )
    def test_the_scene_and_the_job(self, room, key, name):
        (room / "link.blend").symlink_to("room.blend")
        (room / "folder").symlink_to(".")
        job = write_job(room, take(f'{key} = "{name}"'))
        before = (room / "room.blend").read_bytes(), job.read_bytes(), sorted(os.listdir(room))
        code, lines = run(job)
        assert code == 1 and f"'{key}' is the " in lines[0] and "give it another name" in lines[0]
        assert before == ((room / "room.blend").read_bytes(), job.read_bytes(), sorted(os.listdir(room)))

    @pytest.mark.parametrize("key", ["sheet", "video"])
    def test_no_picture_is_meant_for_a_scene(self, tmp_path, key):
        assert (
            "end its name so" in read_job(write_job(tmp_path, take(f'{key} = "room.blend"'))).takes[0].error
        )

    @pytest.mark.parametrize("second", ['report = "x/../r.json"', 'bvh = "R.json"', 'out = "here/r.json"'])
    def test_the_later_of_two_takes_with_one_file_is_refused(self, tmp_path, second):
        (tmp_path / "here").symlink_to(".")
        job = read_job(write_job(tmp_path, take('report = "r.json"') + take(second, "two")))
        assert job.takes[0].error is None and job.takes[0].outputs
        assert "is the same file as 'report' of take 'one'" in job.takes[1].error and not job.takes[1].outputs

    def test_names_that_begin_alike_are_two_files(self, tmp_path):
        body = (
            'out = "sit.blend"\nsheet = "sit.blend.png"\nvideo = "sit"\nbvh = "sit.bvh"\nreport = "sit.json"'
        )
        one = read_job(write_job(tmp_path, take(body))).takes[0]
        assert one.error is None and {p.name for p in one.outputs.values()} == {
            "sit.blend", "sit.blend.png", "sit.mp4", "sit.bvh", "sit.json"
        }  # fmt: skip

    def test_the_scene_is_replaced_where_that_is_said(self, room):
        code, lines = run(write_job(room, take('out = "room.blend"\noverwrite = true')))
        assert code == 0, lines
        bpy.ops.wm.open_mainfile(filepath=str(room / "room.blend"))
        assert bpy.data.objects["Character"].animation_data.action
        code, lines = run(write_job(room, take('report = "room.blend"\noverwrite = true')))
        assert code == 1 and outputs.blend_is_whole(room / "room.blend")

    def test_a_library_of_the_scene(self, room):
        (room / "room.blend").rename(room / "library.blend")
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with bpy.data.libraries.load(str(room / "library.blend"), link=True) as (there, wanted):
            wanted.objects = [name for name in there.objects if name == "Mark"]
        bpy.context.scene.collection.objects.link(wanted.objects[0])
        bpy.ops.wm.save_as_mainfile(filepath=str(room / "room.blend"))
        before = (room / "library.blend").read_bytes()
        code, lines = run(write_job(room, take('out = "library.blend"')))
        assert code == 1 and "which the scene uses" in lines[0]
        assert (room / "library.blend").read_bytes() == before


class TestOneTakeOfMany:
    @pytest.mark.parametrize(
        ("first", "words"),
        [
            (take('report = "a\\u0000b.json"'), "'report' in take 'one' is 'a\\x00b.json'"),
            (
                take("", goals="[{ action = 'idle', hold = 1" + "0" * 400 + " }]"),
                "'hold' in goal 1 of take 'one'",
            ),
            (take('out = "' + "a" * 300 + '.blend"'), "too long"),
            (take('bvh = "' + "abcdefgh/" * 120 + '"'), "too long"),
            (take("start_frame = 4294967296"), "from -1048574 to 1000000"),
            (take("seed = 2147483648"), "from 0 to 2147483647"),
            (
                take("", goals="[{ action = 'walk', location = [nan, 0, 0] }]"),
                "'location' in goal 1 of take 'one' is nan",
            ),
            (take("", goals="[{ action = 'walk', location = [0, 1e300, 0] }]"), "'location' in goal 1"),
            (
                take("", goals="[{ action = 'walk', object = 'a\\u0000' }]".replace("'", '"')),
                "'object' in goal 1",
            ),
            (take("", goals="[[[[]]]]"), "goal 1 of take 'one'"),
            (take('out = "//one.blend"'), "leave '//' away"),
            (take("overwrite = 1"), "'overwrite' in take 'one' is 1; it must be true or false"),
        ],
    )
    def test_what_is_wrong_is_told_and_the_others_stay(self, tmp_path, first, words):
        job = read_job(write_job(tmp_path, first + take('report = "two.json"', "two")))
        assert words in job.takes[0].error and "\n" not in job.takes[0].error
        assert job.takes[1].error is None and job.takes[1].goals

    def test_a_take_that_is_no_table(self, tmp_path):
        path = tmp_path / "job.toml"
        path.write_text(f'scene = "room.blend"\ntake = [3, {{ name = "two", goals = {IDLE} }}]')
        job = read_job(path)
        assert "take 1 is 3" in job.takes[0].error and job.takes[1].error is None

    @pytest.mark.parametrize("code", ["utf-8-sig", "utf-16", "latin-1"])
    def test_encodings(self, tmp_path, code):
        (tmp_path / "job.toml").write_bytes(GOOD.replace('"two"', '"Tür"').encode(code))
        assert [t.name for t in read_job(tmp_path / "job.toml").takes] == ["one", "Tür"]

    @pytest.mark.parametrize("path", ["a\0b.toml", "a" * 5000, "."])
    def test_no_job_file(self, path):
        assert run(Path(path))[0] == 2

    def test_a_defect_is_reported_with_its_traceback_and_the_next_take_is_made(
        self, room, monkeypatch, capfd
    ):
        make = batch._make
        monkeypatch.setattr(
            batch,
            "_make",
            lambda job, entry, *rest: 1 // 0 if entry.name == "one" else make(job, entry, *rest),
        )
        code, lines = run(write_job(room, take('report = "one.json"') + take('report = "two.json"', "two")))
        assert (
            code == 1
            and "Take 'one' broke off with ZeroDivisionError" in lines[0]
            and "please report this" in lines[0]
        )
        assert (
            "Traceback" in json.loads((room / "one.json").read_text())["traceback"]
            and "Traceback" in capfd.readouterr().err
        )
        assert "error" not in json.loads((room / "two.json").read_text())

    def test_names_that_a_terminal_lacks(self, tmp_path):
        code = "from nsm_blender.batch import _say; _say('座る')"
        root = Path(__file__).resolve().parents[2]
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=root,
            capture_output=True,
            env={**os.environ, "PYTHONIOENCODING": "ascii"},
            timeout=120,
        )
        assert done.returncode == 0 and b"\\u5ea7" in done.stdout


@pytest.mark.parametrize("scripts", [False, True])
def test_scripts_of_a_scene_run_only_where_the_job_says_so(room, scripts):
    text = bpy.data.texts.new("mark.py")
    text.write("import bpy; bpy.data.objects['Mark']['ran'] = True")
    text.use_module = True
    bpy.ops.wm.save_as_mainfile(filepath=str(room / "room.blend"))
    (room / "job.toml").write_text(
        f'scene = "room.blend"\nscripts = {str(scripts).lower()}\n' + take('out = "one.blend"')
    )
    code, lines = run(room / "job.toml")
    assert code == 0 and any("scripts in the scene did not run" in line for line in lines) != scripts
    assert ("ran" in bpy.data.objects["Mark"]) == scripts


class TestFullDisk:
    def keep(self, folder: Path, name: str) -> Path:
        (folder / name).write_text("earlier")
        return folder / name

    def check(self, path: Path) -> None:
        assert path.read_text() == "earlier" and os.listdir(path.parent) == [path.name]

    def test_a_picture(self, tmp_path):
        path = self.keep(tmp_path, "one.png")
        with (
            small_files(16384),
            pytest.raises(OutputError, match=r"cut short; the disk may be full.*make room"),
        ):
            render.write_png(path, np.random.default_rng(0).random((300, 300, 4), np.float32))
        self.check(path)

    @pytest.mark.parametrize("compress", [False, True])
    def test_a_scene(self, tmp_path, compress):
        path = self.keep(tmp_path, "one.blend")
        with small_files(16384), pytest.raises(OutputError, match="cannot be written to"):
            outputs.save_blend(path, compress=compress)
        self.check(path)

    def test_a_report(self, tmp_path):
        path = self.keep(tmp_path, "one.json")
        with small_files(500), pytest.raises(OutputError, match="cannot be written to"):
            outputs.write_json(path, {"x": "y" * 5000})
        self.check(path)

    def test_what_is_cut_anywhere_is_not_whole(self, tmp_path):
        outputs.save_blend(tmp_path / "a.blend")
        outputs.save_blend(tmp_path / "b.blend", compress=True)
        render.write_png(tmp_path / "c.png", np.random.default_rng(0).random((20, 20, 4), np.float32))
        boxes = (b"ftypisom....", b"mdat" + b"y" * 300, b"moov" + b"z" * 90)
        (tmp_path / "d.mp4").write_bytes(b"".join((len(box) + 4).to_bytes(4, "big") + box for box in boxes))
        checks = {
            "a.blend": outputs.blend_is_whole,
            "b.blend": outputs.blend_is_whole,
            "c.png": outputs.png_is_whole,
            "d.mp4": outputs.mp4_is_whole,
        }
        for name, is_whole in checks.items():
            data = (tmp_path / name).read_bytes()
            assert is_whole(tmp_path / name)
            for size in (0, 5, 20, len(data) // 2, len(data) - 100, len(data) - 1):
                (tmp_path / "cut").write_bytes(data[:size])
                assert not is_whole(tmp_path / "cut"), (name, size)


JUNK = [
    "true", "-1", "0x7fffffffffffffffffff", "1e400", "nan", "-inf", "1979-05-27", "07:32:00", '""',
    '"\\u0000"', '"a\\nb"', "[]", "{}", "[[[]]]", "{ a = { b = [1] } }", '"room.blend"', '"../"', '"."',
    '"/"', '"' + "x" * 400 + '"', "9" * 500, "9" * 5000, '"//x"', "'one.json'", "[1, 2]", "[nan, 1, 2]",
    '["a"]', "4294967296", "1.5", "'job.toml'",
]  # fmt: skip


def damaged(random_: random.Random) -> bytes:
    """The good job with one to three values, lines or bytes changed."""
    data = GOOD
    for _ in range(random_.randint(1, 3)):
        lines = data.split("\n")
        at = random_.randrange(len(lines))
        kind = random_.randrange(5)
        if kind == 0 and "=" in lines[at]:
            lines[at] = lines[at].split("=")[0] + "= " + random_.choice(JUNK)
        elif kind == 1:
            words = lines[at].split(" ")
            words[random_.randrange(len(words))] = random_.choice(JUNK)
            lines[at] = " ".join(words)
        elif kind == 2:
            lines.insert(at, lines[random_.randrange(len(lines))])
        elif kind == 3:
            del lines[at]
        else:
            lines[at] = lines[at].replace(
                random_.choice("=[]{}\"',0123"), random_.choice("=[]{}\"',0123\0é"), 1
            )
        data = "\n".join(lines)
    raw = bytearray(data.encode())
    if random_.random() < 0.3 and raw:
        raw[random_.randrange(len(raw))] = random_.randrange(256)
    return bytes(raw)


def test_damaged_jobs_are_refused_in_a_sentence_or_are_right(tmp_path):
    random_, path = random.Random(9), tmp_path / "job.toml"
    refused = made = 0
    for _ in range(600):
        path.write_bytes(damaged(random_))
        try:
            job = read_job(path)
        except NsmError as error:
            assert isinstance(error, JobError) and len(str(error)) < 600
            refused += 1
            continue
        require_right(job)
        made += any(entry.error is None for entry in job.takes)
    assert refused > 50 and made > 50


def require_right(job: Job) -> None:
    """Whether everything in a job is what the takes can work with."""
    assert job.takes and type(job.scripts) is bool and "\0" not in str(job.scene)
    for entry in job.takes:
        assert entry.name.isprintable() and all("\0" not in str(path) for path in entry.outputs.values())
        assert all(
            Path(os.path.realpath(path)) not in (job.path, job.scene) for path in entry.outputs.values()
        )
        if entry.error is not None:
            assert len(entry.error) < 600
            continue
        assert (
            type(entry.seed) is int
            and 0 <= entry.seed < 2**31
            and type(entry.start_frame) in (int, float)
            and abs(entry.start_frame) < 2**21
        )
        assert type(entry.contact_ik) is bool and isinstance(entry.character, str) and entry.goals
        for goal in entry.goals:
            assert 0 <= goal.hold <= 600 and all(isinstance(n, str | None) for n in (goal.object, goal.to))
            assert goal.location is None or (
                len(goal.location) == 3 and all(map(math.isfinite, goal.location))
            )
