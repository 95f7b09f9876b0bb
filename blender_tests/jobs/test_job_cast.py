"""Job files with takes of several characters."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import pytest

from nsm_blender import batch
from nsm_blender.jobs.read import read_job
from nsm_blender.rigs.character import add_character

ANNA = '{ character = "Anna", goals = [{ action = "idle", hold = 0.1 }] }'
BEN = '{ character = "Ben", goals = [{ action = "walk", location = [2.5, -0.8, 0.0], hold = 0.1 }] }'


def write_job(folder: Path, body: str) -> Path:
    path = folder / "job.toml"
    path.write_text(f'scene = "room.blend"\n[[take]]\nname = "two"\n{body}\n', encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        (f"characters = [{ANNA}]", "'characters' needs two at least"),
        (f"characters = [{ANNA}, {ANNA}]", "'Anna' is among the characters twice"),
        (f'characters = [{ANNA}, {BEN}]\ncharacter = "Anna"', "remove 'character'"),
        (f'characters = [{ANNA}, {BEN}]\nbvh = "two.bvh"', "'bvh' is of one character"),
        (f'characters = [{ANNA}, {{ character = "Ben" }}]', "The key 'goals' is missing in character 2"),
        (f'characters = [{ANNA}, {{ character = "Ben", goals = [], rig = "x" }}]', "The key 'rig' in"),
        ('characters = "all"', "'characters' in take 'two'"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, body, sentence):
    assert sentence in (read_job(write_job(tmp_path, body)).takes[0].error or "")


def test_those_of_one_take_act_together(tmp_path):
    for name, place in (("Anna", (0.0, 0.0, 0.0)), ("Ben", (1.5, 0.0, 0.0))):
        add_character(place).name = name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    body = f'characters = [{ANNA}, {BEN}]\nout = "two.blend"\nreport = "two.json"'
    lines: list[str] = []
    assert batch.main([str(write_job(tmp_path, body))], lines.append) == 0, lines
    report = json.loads((tmp_path / "two.json").read_text())
    assert [(g["character"], g["action"], g["reached"]) for g in report["goals"]] == [
        ("Anna", "idle", True),
        ("Ben", "walk", True),
    ]
    assert [c["character"] for c in report["characters"]] == ["Anna", "Ben"]
    assert all(c["waits"] == [] for c in report["characters"]) and report["frames"] > 30
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "two.blend"))
    actions = {bpy.data.objects[name].animation_data.action for name in ("Anna", "Ben")}
    assert len(actions) == 2 and None not in actions
    assert bpy.context.scene.frame_end == report["frames"]
