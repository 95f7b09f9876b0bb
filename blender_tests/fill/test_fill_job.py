"""Gaps that a job file has filled."""

from __future__ import annotations

import json

import bpy
import pytest
from gaps import cut, walk, walking

from nsm_blender import batch
from nsm_blender.jobs.read import read_job
from nsm_blender.pictures.outputs import blend_is_whole
from nsm_blender.rigs.character import add_character

START, END = 40, 66
FILL = f'[[fill]]\ncharacter = "Hero"\nfrom = {START}\nto = {END}\n'


@pytest.fixture(scope="module", autouse=True)
def motion():
    """The walk, made before a test opens its scene."""
    return walk()


def job(folder, text: str):
    path = folder / "job.toml"
    path.write_text(f'scene = "walk.blend"\n{text}', encoding="utf-8")
    return path


def test_a_job_fills_gaps_and_reports_them(tmp_path):
    character = add_character((0.0, 0.0, 0.0))
    character.name = "Hero"
    walking(character, 30)
    cut(character, START, END)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "walk.blend"))
    how = 'method = "interpolate"\n'
    path = job(
        tmp_path,
        f'{FILL}{how}seed = 3\nname = "middle"\nout = "filled.blend"\nreport = "filled.json"\n'
        f'{FILL.replace(f"to = {END}", "to = 4000")}{how}report = "beyond.json"\n',
    )
    lines: list[str] = []
    assert batch.main([str(path)], lines.append) == 1
    told = json.loads((tmp_path / "filled.json").read_text(encoding="utf-8"))
    assert told["frames"] == END - START - 1 and told["seed"] == 3 and told["name"] == "middle"
    assert {"gap_before_blend_cm", "slide_cm_s", "penetration_cm"} <= told.keys() and "error" not in told
    assert "no keys after the gap" in json.loads((tmp_path / "beyond.json").read_text())["error"]
    assert "1 of 2 takes are as asked for." in lines[-1]
    assert blend_is_whole(tmp_path / "filled.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "filled.blend"))
    assert bpy.data.objects["Hero"].animation_data.action.name == "middle"


def test_what_is_wrong_with_an_entry_is_told(tmp_path):
    for line, words in (
        ("seed = -1", "'seed' in fill 'fill 1'"),
        ('method = "magic"', "'method' in fill 'fill 1' is 'magic'"),
        ("replace = 1", "must be true or false"),
        ("length = 3", "the keys are name, character, rig, from, to"),
        ('bvh = "a.bvh"', "'bvh' in fill 'fill 1' is unknown"),
    ):
        entry = read_job(job(tmp_path, FILL + line)).takes[0]
        assert words in (entry.error or ""), (line, entry.error)
    assert "The key 'to' is missing" in read_job(job(tmp_path, "[[fill]]\nfrom = 3\n")).takes[0].error
    one = read_job(job(tmp_path, FILL.replace(str(START), "40.5"))).takes[0]
    assert one.error is None and one.fill.start == 40.5 and one.fill.method == "network"
