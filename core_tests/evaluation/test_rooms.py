"""The benchmark of rooms: the same of a seed, judged, kept, and the worst drawn."""

from __future__ import annotations

import json

import numpy as np
import pytest

from nsm_core.commands import rooms
from nsm_core.evaluation.trials.room_goals import ACTIONS, badness, room_take, rooms_table


def test_a_seed_is_one_room_and_one_goal():
    one, other = room_take(7), room_take(7)
    assert one.goals[0].action == other.goals[0].action == ACTIONS[1]
    np.testing.assert_array_equal(one.start_position, other.start_position)
    np.testing.assert_array_equal(one.goals[0].position, other.goals[0].position)
    assert [room_take(s).goals[0].action for s in range(6)] == list(ACTIONS)


def test_rooms_are_run_once_and_the_worst_drawn(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    given = ["--rooms", "0:1", "--worst", "1", "--out", str(tmp_path)]
    assert rooms.main(given) == 0
    (line,) = (tmp_path / "rooms.jsonl").read_text().splitlines()
    report = json.loads(line)
    assert report["room"] == 0 and report["action"] == "walk" and report["success"] == report["reached"] == 1
    assert 0.9 < report["path_ratio"] < 1.6 and report["jerk_m_s3"] > 0
    drawn = sorted(path.name for path in tmp_path.glob("*.png"))
    assert drawn == ["worst_00_room_0.png", "worst_00_room_0_plan.png"]
    told = (tmp_path / "rooms.md").read_text(encoding="utf-8")
    assert "| success | 100% | 100% |" in told
    with (tmp_path / "rooms.jsonl").open("a") as file:
        file.write('{"room": 1, "act')  # of a run that was stopped
    assert rooms.main([*given[:3], "0", *given[4:]]) == 0
    assert (tmp_path / "rooms.md").read_text(encoding="utf-8") == told


def test_failures_are_the_worst_and_count_as_no_success():
    figures = {"reached": 1.0, "success": 1.0, "penetration_cm": 2.0, "slide_moving_cm_s": 10.0}
    deep, failed = figures | {"success": 0.0}, {"failed": 1.0, "reached": 0.0, "success": 0.0}
    assert badness(figures) < badness(figures | {"penetration_cm": 9.0}) < badness(deep) < badness(failed)
    text = rooms_table([("walk", figures), ("walk", failed), ("sit", deep)])
    assert "| 3 rooms | walk | sit | all |" in text and "| success | 50% | 0% | 33% |" in text
