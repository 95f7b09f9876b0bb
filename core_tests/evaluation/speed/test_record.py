"""Figures of a benchmark in one file."""

from __future__ import annotations

import json

import pytest

from nsm_core.errors import OutputError
from nsm_core.evaluation.speed.record import TARGETS, add


def test_parts_gather_in_one_file_and_say_what_misses_its_target(tmp_path, capsys):
    file = tmp_path / "figures.json"
    add(file, "core", {"whole": 2.0}, {"network_over_memory_floor": 2.0, "sensing_over_python_loop": 0.3})
    add(file, "blender", {"take": 1.0}, {"real_time_over_frame": 9.0, "network_over_memory_floor": 1.2})
    held = json.loads(file.read_text())
    assert held["core"] == {"whole": 2.0} and held["blender"] == {"take": 1.0}
    assert (
        held["ratios"]["network_over_memory_floor"] == 1.2
        and held["ratios"]["sensing_over_python_loop"] == 0.3
    )
    assert held["targets"]["network_over_memory_floor"] == {"aim": "<= 1.5", "met": True}
    assert set(held["targets"]) == {"network_over_memory_floor", "real_time_over_frame"} <= set(TARGETS)
    told = capsys.readouterr().out.splitlines()
    assert [line.endswith("missed") for line in told] == [True, False, False, False]


def test_a_file_of_something_else_is_left_alone(tmp_path):
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    with pytest.raises(OutputError, match="notes.txt holds no figures"):
        add(file, "core", {}, {})
    assert file.read_text() == "mine"
