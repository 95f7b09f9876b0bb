"""What the network does in trials becomes figures, tables and sheets."""

from __future__ import annotations

import json

import numpy as np
import pytest
from captures import data_folder

from nsm_core.body.skeleton import J
from nsm_core.commands.evaluate import main
from nsm_core.control.take import TakeResult
from nsm_core.conventions import CLIMB, FPS
from nsm_core.errors import GoalError, OutputError
from nsm_core.evaluation import report as evaluation_report
from nsm_core.evaluation.measures.data_baseline import _ground, slide_of_data
from nsm_core.evaluation.trials import carry, interrupt, locomotion, rollout, stress
from nsm_core.evaluation.trials import open as doors
from nsm_core.evaluation.trials import sit as trials_sit
from nsm_core.evaluation.trials.suite import ABLATIONS, PARTS, Figures
from nsm_core.evaluation.trials.together import alone
from nsm_core.model.features.layout import INPUT, Inputs
from nsm_core.model.inference.model import Model, load_model
from nsm_core.rotations import heading_to_direction
from nsm_core.world.affordances.passage import passage
from nsm_core.world.scene import furniture
from nsm_core.world.sensors.interaction import interaction_sensor


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


# --- judging ---


def test_a_door_counts_as_passed_only_through_its_opening():
    trial = doors.trials(1)[0]
    leaf = doors.request(trial).goals[0].prop
    way = passage(leaf, trial.start)
    ahead = heading_to_direction(np.array(way.heading))
    side = np.array((-ahead[1], ahead[0]))
    through = way.middle + np.linspace(-2.01, 0.99, 91)[:, None] * ahead
    assert doors.passed_at(through, way, leaf.width) == pytest.approx(70 / FPS)
    assert np.isnan(doors.passed_at(through[:60], way, leaf.width))
    assert np.isnan(doors.passed_at(through + 1.0 * side, way, leaf.width)), "through the wall"


def test_standing_frozen_needs_both_root_and_pose_to_rest():
    root, local = np.zeros((700, 3)), np.zeros((700, J, 4))
    local[..., 0] = 1
    assert stress.stands_frozen(root, local) and not stress.stands_frozen(root[:590], local[:590])
    nodding = local.copy()
    nodding[::40, 5] = (np.cos(0.05), np.sin(0.05), 0, 0)
    assert not stress.stands_frozen(root, nodding)
    swaying = root.copy()
    swaying[:, 0] = 0.04 * np.sin(np.arange(700) / 50)
    assert not stress.stands_frozen(swaying, local)


def test_jumps_are_told_from_those_of_the_rest():
    rotations = np.zeros((200, J, 4))
    rotations[..., 0] = 1
    hips = np.zeros((200, 3))
    hips[:, 0] = 0.03 * np.arange(200)
    take = TakeResult(hips, rotations, hips, rotations, *(np.zeros((200, n)) for n in (5, 3, 7, 8)), [], {})
    rotations[120:, 5] = (np.cos(0.2), np.sin(0.2), 0, 0)
    assert interrupt.jump_report(take, 119)["popped"] == 1
    assert interrupt.jump_report(take, 119)["there_turn_per_frame_deg"] == pytest.approx(
        np.degrees(0.4), abs=0.01
    )
    assert interrupt.jump_report(take, 60)["popped"] == 0


def test_counts_of_random_goals_add_up():
    outcomes = [
        stress.Outcome(0, 50.0, "", False, ["carry"], {"walk": [2, 2], "carry": [1, 0]}, 1500, 30),
        stress.Outcome(1, 70.0, "GoalError: N m", True, [], {"walk": [2, 1]}, 500, 70),
        stress.Outcome(2, 10.0, "GoalError: N m", False, given_up=["no way to N m"]),
    ]
    s = stress.summarise(outcomes)
    assert (
        s["seconds"] == 130
        and s["not_finite"] == 1
        and s["frozen"] == 1
        and s["errors"] == {"GoalError: N m": 2}
    )
    assert s["asked_reached"] == {"walk": [4, 3], "carry": [1, 0]} and s["deep_share"] == pytest.approx(0.05)
    assert s["frozen_seeds"] == [0] and s["error_seeds"] == [1, 2]
    text = stress.stress_table(s)
    assert (
        "3 of 4 (75%)" in text
        and "of these: GoalError: N m | 2" in text
        and "passed over: no way to N m | 1" in text
    )
    assert stress.message_of(GoalError("at (1.25, -3) m")) == "GoalError: at (N, N) m"


def test_a_summary_counts_what_broke_off_as_not_reached():
    reports = [
        {
            "reached": 1.0,
            "pe_cm": 2.0,
            "frames": 100.0,
            "deep_frames": 5.0,
            "slide_all_total": 2.0,
            "slide_all_count": 10.0,
        }
    ] * 3
    s = rollout.summarise([*reports, {"reached": 0.0, "failed": 1.0, "error": "GoalError: no"}])
    assert (
        s["reached"] == 0.75
        and s["failed"] == 1
        and s["pe_cm_mean"] == 2
        and s["deep_share"] == pytest.approx(0.05)
    )
    assert s["slide_all"] == pytest.approx(20) and "error_mean" not in s


def test_tables_print_ours_beside_the_paper_and_the_aim():
    report = {"reached": 1.0, "network_pe_cm": 2.5, "network_re_deg": 1.0, "pe_cm": 0.5, "re_deg": 0.3}
    report |= {"penetration_end_cm": 0.0, "seconds": 5.0}
    broken = {"reached": 0.0, "failed": 1.0, "error": "ValueError: x"}
    result = {
        "sit": trials_sit.summarise([report, broken]),
        "sit, interaction sensor zeroed": trials_sit.summarise([report | {"network_pe_cm": 9.0}]),
        "carry": carry.summarise([broken]),
        "data": {"walk": 9.0, "all": 8.0},
        "trials": [
            {"part": "carry", "ablation": None, "setting": 0, "name": "x", **broken},
            {"part": "carry", "ablation": None, "setting": 1, "name": "y", "placed": 1.0, "touched": "mug"},
        ],
    }
    text = evaluation_report.tables(result)
    assert "| sit PE cm, network alone (mean / median) | 2.50 / 2.50 | 2.93 | 2.9 |" in text
    assert (
        "| interaction sensor zeroed at run time, not retrained: PE cm, network alone | 9.00 | 3.72 "
        "(retrained) |  |" in text
    )
    assert "end free of penetration | 50% |" in text and "broke off 1 x carry: ValueError: x" in text
    assert "| placed: x | 0 of 1 |" in text and "| placed: y | 1 of 1 |" in text
    assert text.endswith("\ncarry: mug")
    assert "| walk |  | 9.0 | 11.0 |" in text
    assert np.isnan(Figures()["whatever"])


def test_a_blind_network_reads_nothing_of_one_sensor(model):
    seen = []

    class Eye:
        backend, config, metadata = "numpy", model.config, model.metadata

        def step(self, inputs, memory):
            seen.append(inputs.features)
            return inputs.features, memory, {}

    x = np.ones((1, INPUT.size), np.float32)
    for ablation in ABLATIONS:
        network, options = evaluation_report.without(Eye(), ablation)
        network.step(Inputs(x, x), {})
        assert bool(options) == ablation.startswith("no ")
    assert (x == 1).all() and (seen[0] == 1).all()
    for given, sensor in zip(seen[1:], ("interaction", "environment"), strict=True):
        assert (given[:, INPUT.slices[sensor]] == 0).all() and given.sum() == INPUT.size - (given == 0).sum()
        assert (given == 0).sum() == INPUT.slices[sensor].stop - INPUT.slices[sensor].start


# --- roll-outs on the shipped weights ---


def test_figures_of_a_sit_and_of_a_walk_through_a_hole(model):
    _, sit = alone(trials_sit.run_trial(model, trials_sit.trials(1)[0]))
    summary = trials_sit.summarise([sit])
    assert summary["success"] == 1 and summary["within_3cm_3deg_ik"] == 1 and sit["network_pe_cm"] < 10
    assert 0 < summary["slide_all"] < 20 and sit["frames"] > 60
    hole = next(t for t in locomotion.trials(1) if t.name == "hole")
    _, walk = alone(locomotion.run_trial(model, hole))
    assert walk["reached"] == 1 and walk["penetration_cm"] < 3 and 0.9 < walk["path_ratio"] < 1.3
    text = evaluation_report.tables({"sit": summary, "travel": locomotion.summarise([walk])})
    assert "walks through a wall with a hole: reached | 100% |" in text


@pytest.mark.parametrize("part", ["carry", "open", "climb"])
def test_every_line_of_a_part_has_its_figure(model, part):
    trial = PARTS[part].trials(1, None)[0]
    _, report = alone(PARTS[part].run(model, trial, time_limit=1.0))
    summary = PARTS[part].summarise([report])
    missing = []

    class Asked(Figures):
        def __missing__(self, key):
            missing.append(key)
            return float("nan")

    PARTS[part].rows(Asked(summary))
    assert not missing
    json.dumps(evaluation_report._plain({"summary": summary, "report": report}), allow_nan=False)


def test_an_order_is_answered(model):
    order = locomotion.orders(1)[1]
    take, report = alone(locomotion.run_order(model, order))
    assert order.name == "idle to walk" and 0.1 < report["idle_to_walk_s"] < 2 and report["reached"] == 1
    assert len(take.root) > 3


def test_the_command_runs_parts_and_writes_what_it_printed(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["--only", "dance"])
    assert "there is no part dance" in capsys.readouterr().err
    assert main(["--only", "none", "--out", str(tmp_path / "a" / "e.json")]) == 0
    assert json.loads((tmp_path / "a" / "e.json").read_text()) == {"trials": []}
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="folder"):
        evaluation_report.write_report({}, tmp_path / "file" / "x.json")


# --- the data's own slide ---


def test_the_slide_of_the_data_is_measured_over_what_is_climbed(tmp_path_factory):
    folder = data_folder(tmp_path_factory)
    slide = slide_of_data(folder)
    assert {"idle", "walk", "all"} <= set(slide) and 0 <= slide["idle"] < slide["walk"] < 60
    assert slide_of_data(folder, most=0.01)["all"] != slide["all"]
    step = furniture.make("step", np.random.default_rng(0), height=0.32, depth=0.8, width=1.0)
    volume = interaction_sensor(furniture.cuboids([(step, np.zeros(2), 0.0)]), step.centre, step.size, 0.0)
    arrays = {
        "object": np.zeros(10, np.int32),
        "object_pose": np.tile(np.array((2.0, 1.0, 0.0, np.pi / 2)), (10, 1)),
        "object_cells": volume.cells_world()[None],
        "object_occupancy": volume.occupancy[None],
    }
    style = np.zeros((10, 7))
    assert _ground(arrays, slice(0, 10), style) is None
    style[:, CLIMB] = 1
    ground = _ground(arrays, slice(0, 10), style)
    places = np.array(((2.0, 1.0), (2.39, 1.49), (2.41, 1.0), (2.0, 1.51), (0, 0)))
    assert np.allclose(ground(places), (0.32, 0.32, 0, 0, 0), atol=1e-5)
