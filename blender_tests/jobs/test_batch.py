"""Job files, and a batch whose bad takes do not take the good ones with them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from scenes import empty, furnish

from nsm_blender import batch
from nsm_blender.jobs.read import read_job
from nsm_blender.rigs.character import add_character
from nsm_core.data.captures import reader
from nsm_core.errors import JobError

ROOT = Path(__file__).resolve().parents[2]
KEYS = {
    "name", "frames", "fps", "goals", "foot_sliding_cm_s", "planted_share", "top_speed_m_s", "penetration_cm",
    "ms_per_frame",
}  # fmt: skip
GOAL_KEYS = {"object", "action", "reached", "seconds", "position_error_cm", "rotation_error_deg"}
STAGES = {"goals", "sensors", "network", "blending", "ik", "keying", "total"}


def write_job(folder: Path, text: str) -> Path:
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return path


def save_room(folder: Path) -> None:
    """A room with a character two metres from a chair."""
    add_character((0.0, 0.0, 0.0))
    furnish("chair", "Chair", (0.3, -2.2), 0.4)
    empty("Mark", (1.5, 0.5, 0.0))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "room.blend"))


def run(path: Path) -> tuple[int, list[str]]:
    lines: list[str] = []
    return batch.main([str(path)], lines.append), lines


def take(body: str = "", name: str = "one", goals: str = '[{ object = "Chair", action = "sit" }]') -> str:
    return f'[[take]]\nname = "{name}"\ngoals = {goals}\n{body}\n'


class TestJobFile:
    def test_everything_that_it_can_say(self, tmp_path):
        goals = (
            '[{ object = "Chair", action = "sit", hold = 3 }, { action = "walk", location = [1, 2.5, 0] }, '
            '{ action = "idle" }]'
        )
        body = (
            'character = "Ann"\nseed = 4\nstart_frame = 10\ncontact_ik = false\nin_order = true\n'
            'out = "a/sit.blend"\nreport = "sit.json"'
        )
        job = read_job(write_job(tmp_path, 'scene = "rooms/room.blend"\n' + take(body, goals=goals)))
        one = job.takes[0]
        assert job.scene == tmp_path / "rooms/room.blend"
        assert (one.error, one.name, one.character, one.seed, one.start_frame, one.contact_ik) == (
            None,
            "one",
            "Ann",
            4,
            10,
            False,
        )
        assert one.in_order
        assert [(g.action, g.object, g.hold, g.location) for g in one.goals] == [
            ("sit", "Chair", 3.0, None), ("walk", None, 2.0, (1.0, 2.5, 0.0)), ("idle", None, 2.0, None)
        ]  # fmt: skip
        assert one.outputs == {"out": tmp_path / "a/sit.blend", "report": tmp_path / "sit.json"}

    def test_every_action(self, tmp_path):
        goals = (
            '[{ object = "Box", action = "carry", to = "Table" }, { object = "Door", action = "open" }, '
            '{ object = "Step", action = "climb" }, { location = [1, 2, 0], action = "run" }, { action = '
            '"idle", hold = 3.0 }]'
        )
        one = read_job(write_job(tmp_path, 'scene = "a.blend"\n' + take(goals=goals))).takes[0]
        assert one.error is None
        assert [(g.action, g.object, g.to, g.location, g.hold) for g in one.goals] == [
            ("carry", "Box", "Table", None, 2.0),
            ("open", "Door", None, None, 2.0),
            ("climb", "Step", None, None, 2.0),
            ("run", None, None, (1.0, 2.0, 0.0), 2.0),
            ("idle", None, None, None, 3.0),
        ]

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("scene = ", "not valid TOML"),
            (take(), "'scene' is missing"),
            ("scene = 3\n" + take(), "'scene' in the job file is 3; it must be a text in quotes"),
            ('scene = "a.blend"', "no takes"),
            ('scene = "a.blend"\ntake = 3', "no takes"),
            (
                'scene = "a.blend"\nspeed = 3\n' + take(),
                "'speed' in the job file is unknown; the keys are scene, scripts, take",
            ),
        ],
    )
    def test_what_is_wrong_with_the_file(self, tmp_path, text, words):
        with pytest.raises(JobError, match=words):
            read_job(write_job(tmp_path, text))

    def test_missing_file(self, tmp_path):
        with pytest.raises(JobError, match="cannot be read"):
            read_job(tmp_path / "none.toml")

    @pytest.mark.parametrize(
        ("entry", "words"),
        [
            (take("seed = true"), "'seed' in take 'one' is true; it must be a whole number"),
            (take("seed = -1"), "'seed' in take 'one' is -1; it must be a whole number from 0"),
            (take("sheet = 5"), "'sheet' in take 'one' is 5"),
            (take('colour = "red"'), "'colour' in take 'one' is unknown"),
            (take(goals="[]"), "'goals' is empty"),
            (take(goals="[3]"), "goal 1 of take 'one'"),
            (
                take(goals='[{ action = "fly" }]'),
                "'fly' is not one of sit, walk, idle, run, carry, open, climb",
            ),
            (take(goals='[{ action = "sit" }]'), "'object' is missing in goal 1 of take 'one'"),
            (take(goals='[{ action = "walk" }]'), "needs an 'object' or a 'location'"),
            (take(goals='[{ action = "walk", location = [1, 2] }]'), "three numbers"),
            (
                take(goals='[{ object = "Chair", action = "sit", hold = -2 }]'),
                "'hold' in goal 1 of take 'one' is -2; it must be",
            ),
            (take(goals='[{ object = "Chair", action = "idle" }]'), "'idle' stands where"),
            (take(goals='[{ object = "Chair", action = "sit", wait = 2 }]'), "'wait' in goal 1"),
            (take(goals='[{ object = "Box", action = "carry" }]'), "'to' is missing in goal 1 of take 'one'"),
            (
                take(goals='[{ object = "Chair", action = "sit", to = "Table" }]'),
                "'to' says where a thing is brought",
            ),
            (take(goals='[{ action = "open" }]'), "'object' is missing in goal 1"),
            (take(goals='[{ action = "run" }]'), "'run' needs an 'object' or a 'location'"),
            (
                take(goals='[{ object = "Step", action = "climb", location = [1, 2, 0] }]'),
                "'climb' needs its 'object' alone",
            ),
            ("[[take]]\ngoals = []\n", "'name' is missing in take 'take 1'"),
            (take('out = "b.blend"\nbvh = "b.blend"'), "'bvh' is the same file as 'out' of take 'one'"),
        ],
    )
    def test_what_is_wrong_with_a_take_stays_with_the_take(self, tmp_path, entry, words):
        job = read_job(write_job(tmp_path, 'scene = "a.blend"\n' + entry + take(name="good")))
        assert words in job.takes[0].error
        assert job.takes[1].error is None and job.takes[1].goals


class TestFailures:
    """None of these takes gets as far as the network."""

    @pytest.mark.parametrize(
        ("body", "words"),
        [
            (
                take('report = "one.json"\ncharacter = "Bob"'),
                "no character 'Bob'; its armatures are Character",
            ),
            (
                take('report = "one.json"', goals='[{ object = "Throne", action = "sit" }]'),
                "no object 'Throne'; it has Chair",
            ),
            (take('report = "one.json"', goals='[{ object = "Mark", action = "sit" }]'), "Mark"),
            (take('report = "one.json"\nseed = "x"'), "'seed'"),
            (take('report = "one.json"\nout = "room.blend/x/sit.blend"'), "'out'"),
            (take('report = "one.json"\ncharacter = "Chair"'), "Chair is not an armature"),
            (
                take('report = "one.json"', goals='[{ object = "Chair", action = "carry", to = "Moon" }]'),
                "correct 'to'",
            ),
            (take('report = "one.json"', goals='[{ object = "Chair", action = "open" }]'), "Chair measures"),
        ],
    )
    def test_the_reason_is_in_report_and_output(self, tmp_path, body, words):
        save_room(tmp_path)
        code, lines = run(write_job(tmp_path, 'scene = "room.blend"\n' + body))
        assert code == 1
        error = json.loads((tmp_path / "one.json").read_text())["error"]
        assert words in error and error in "\n".join(lines)
        assert "Traceback" not in "\n".join(lines)

    def test_missing_and_foreign_scene(self, tmp_path):
        job = write_job(tmp_path, 'scene = "room.blend"\n' + take('report = "one.json"'))
        code, lines = run(job)
        assert code == 1 and "does not exist" in lines[0]
        (tmp_path / "room.blend").write_text("not a scene")
        code, lines = run(job)
        assert code == 1 and "cannot be opened" in lines[0]

    def test_unwritable_report(self, tmp_path):
        save_room(tmp_path)
        code, lines = run(
            write_job(tmp_path, 'scene = "room.blend"\n' + take('report = "room.blend/one.json"'))
        )
        assert code == 1 and "'report'" in lines[0]

    def test_useless_job_file(self, tmp_path):
        assert run(write_job(tmp_path, "scene = "))[0] == 2
        assert batch.main([], [].append) == 2

    @pytest.mark.skipif(not bpy.app.module, reason="the application has no Python with bpy to start")
    def test_as_a_script(self, tmp_path):
        done = subprocess.run(
            [
                sys.executable,
                str(ROOT / "nsm_blender" / "batch.py"),
                str(write_job(tmp_path, 'scene = "none.blend"\n' + take())),
            ],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 1, done.stderr
        assert "does not exist" in done.stdout and "Traceback" not in done.stderr


class TestTakes:
    def test_a_bad_take_does_not_lose_the_good_one(self, tmp_path):
        save_room(tmp_path)
        bad = take('report = "bad.json"', name="bad", goals='[{ object = "Throne", action = "sit" }]')
        goals = '[{ object = "Chair", action = "sit", hold = 1.0 }]'
        good = take(
            'report = "good.json"\nout = "made/good.blend"\nbvh = "good.bvh"\nsheet = "good.png"',
            name="good",
            goals=goals,
        )
        code, lines = run(write_job(tmp_path, 'scene = "room.blend"\n' + bad + good))
        assert code == 1 and any("Throne" in line for line in lines)
        assert set(json.loads((tmp_path / "bad.json").read_text())) == {"name", "error"}
        report = json.loads((tmp_path / "good.json").read_text())
        assert KEYS <= set(report) and "error" not in report
        assert GOAL_KEYS <= set(report["goals"][0]) and STAGES == set(report["ms_per_frame"])
        assert report["goals"][0]["reached"]
        assert (tmp_path / "good.png").stat().st_size > 10_000
        clip = reader.read_clip(tmp_path / "good.bvh")
        assert len(clip) / 30 == pytest.approx(report["frames"] / report["fps"], abs=0.1)
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "made" / "good.blend"))
        action = bpy.data.objects["Character"].animation_data.action
        assert action.name == "good"
        assert bpy.context.scene.frame_end - bpy.context.scene.frame_start + 1 == report["frames"]

    def test_takes_start_from_a_fresh_scene_and_seeds_repeat(self, tmp_path):
        save_room(tmp_path)
        text = 'scene = "room.blend"\n'
        for name, seed in (("a", 3), ("b", 3), ("c", 4)):
            text += take(
                f'seed = {seed}\nbvh = "{name}.bvh"',
                name=name,
                goals='[{ action = "walk", location = [1, -1, 0], hold = 0.5 }]',
            )
        code, lines = run(write_job(tmp_path, text))
        assert code == 0, lines
        a, b = ((tmp_path / f"{name}.bvh").read_text() for name in "ab")
        assert a == b
