"""The comparison: who takes part, what plays captures instead of a network, tables and figures of results."""

from __future__ import annotations

import json
from dataclasses import replace

import captures
import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs PyTorch")

from nsm_core.commands import rivals, train
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.conventions import GOAL_ACTIONS, SIT
from nsm_core.errors import WeightsError
from nsm_core.evaluation.comparison import captured, tables, trying
from nsm_core.evaluation.comparison.captured import CapturedModel
from nsm_core.evaluation.comparison.entrants import ENTRANTS, NETWORKS
from nsm_core.evaluation.comparison.plots import draw_figures
from nsm_core.model.features.codec import build_inputs, build_targets, read_outputs
from nsm_core.model.features.rollout_step import Blending, advance
from nsm_core.model.features.state import PIVOT
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.geometry.distance import Cuboids

STILL = Blending(False, False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return captures.data_folder(tmp_path_factory)


@pytest.fixture(scope="module", params=["clips", "matching"])
def model(folder, request) -> CapturedModel:
    return CapturedModel.open(folder, request.param)


def seen(model: CapturedModel, state, frames):
    """Inputs of a state amid the data's surroundings of ``frames``."""
    return build_inputs(state, model.data.surroundings(frames, state.root))


def approach(data, before: int = 40) -> int:
    """A frame in which a sit is asked for, ``before`` frames ahead of its end."""
    asked = data.arrays["goal_action"][:, PIVOT, GOAL_ACTIONS.index("sit")] > 0.5
    sits = asked & (data.arrays["style"][:, SIT] > 0.9)
    end = int(np.flatnonzero(sits & ~np.roll(sits, 1))[0])
    assert asked[end - before : end].all()
    return end - before


@pytest.mark.parametrize("key", [k for k, e in ENTRANTS.items() if not e.captured])
def test_training_understands_what_each_is_trained_by(key):
    with pytest.raises(WeightsError, match="abacus"):
        train.main(["nowhere", *ENTRANTS[key].arguments, "--device", "abacus"])


def test_the_paper_is_quoted_for_every_network_of_its_tables():
    told = {e.title.partition(",")[0]: e for e in NETWORKS if e.response}
    assert list(told) == ["NSM", "MLP", "PFNN", "MANN", "Auto-LSTM", "LSTM"]
    assert told["NSM"].precision == (2.93, 0.92, 3.05, 1.02) and told["LSTM"].response[0] == 2.16
    assert ENTRANTS["no-environment-sensor"].precision[2] == 8.52


def test_what_is_played_goes_on_as_it_was_captured(model):
    frames = np.array([approach(model.data), int(model.data.frames[30])])
    state = model.data.state(frames)
    memory = {"frame": frames[:, None].astype(np.float32), "since": np.zeros((2, 1), np.float32)}
    y, memory, info = model.step(seen(model, state, frames), memory)
    assert info == {} and memory["frame"][:, 0].tolist() == (frames + 1).tolist()
    expected = build_targets(state, model.data.state(frames + 1), model.data.arrays["contact"][frames + 1])
    np.testing.assert_allclose(y, expected, atol=1e-4)


@pytest.mark.parametrize("kind", ["clips", "matching"])
def test_what_is_found_first_is_asked_for_the_same(folder, kind):
    model = CapturedModel.open(folder, kind)
    frames = np.array([approach(model.data), int(model.data.frames[30])])
    state = model.data.state(frames)
    _, memory, _ = model.step(seen(model, state, frames), model.start(2))
    found = model.data.state(memory["frame"][:, 0].astype(int) - 1)
    np.testing.assert_array_equal(found.goal_action[:, PIVOT] > 0.5, state.goal_action[:, PIVOT] > 0.5)


def test_a_clip_arrives_at_a_goal_that_is_elsewhere(folder):
    model = CapturedModel.open(folder, "clips")
    frame = approach(model.data)
    frames, shift, turn = np.array([frame]), np.array((0.12, -0.08)), 0.2
    state = model.data.state(frames)
    state.goal_position = state.goal_position + np.append(shift, 0).astype(np.float32)
    state.goal_heading = state.goal_heading + np.float32(turn)
    memory = {"frame": np.array([[frame]], np.float32), "since": np.zeros((1, 1), np.float32)}
    for _ in range(40):
        y, memory, _ = model.step(seen(model, state, frames), memory)
        state = replace(
            advance(state, read_outputs(y, state), STILL),
            goal_position=state.goal_position, goal_heading=state.goal_heading,
        )  # fmt: skip
    true = model.data.state(frames + 40)
    own, captured_ = (
        rotate_planar(s.goal_position[:, PIVOT, :2] - s.root[:, :2], -s.root[:, 2]) for s in (state, true)
    )
    assert int(memory["frame"][0, 0]) == frame + 40
    assert np.abs(own - captured_).max() < 0.02
    off = wrap_angle(state.goal_heading[:, PIVOT] - state.root[:, 2]) - wrap_angle(
        true.goal_heading[:, PIVOT] - true.root[:, 2]
    )
    assert abs(float(off[0])) < 0.03


def test_what_it_searches_depends_on_the_kind(folder):
    model = CapturedModel.open(folder, "matching")
    frames = np.array([approach(model.data)])
    inputs, since = seen(model, model.data.state(frames), frames), []
    memory = model.start(1)
    for _ in range(2 * captured.EVERY):
        _, memory, _ = model.step(inputs, memory)
        since.append(int(memory["since"][0, 0]))
    assert since == 2 * list(range(captured.EVERY))


def test_the_controller_steps_what_plays_captures(model):
    goal = Goal("walk", "there", np.array((0.3, -3.0, 0.0)), 0.0)
    runner = TakeRunner(model, TakeRequest(np.zeros(2), 0.0, [goal], Cuboids([]), blending=STILL))
    while runner.frames < 60 and runner.step():
        pass
    assert runner.state.root[0, 1] < -0.5 and np.isfinite(runner.state.joint_position).all()
    assert trying.blending_of(model) == STILL


def test_every_seed_of_evaluation_has_trials_of_its_own():
    jobs = trying.jobs_of([0, 1], 5, None)
    again = trying.jobs_of([1], 5, None)
    starts = {s: [t.start.tolist() for seed, part, t in jobs if seed == s and part == "sit"] for s in (0, 1)}
    assert len(starts[0]) == len(starts[1]) == 5 and starts[0] != starts[1]
    assert starts[1] == [t.start.tolist() for _, part, t in again if part == "sit"]
    assert len([1 for _, part, _ in again if part == "response"]) == 8 + 2 * 5


def test_figures_of_a_trial_and_of_one_that_breaks_off():
    shipped, job = load_model(backend="numpy"), trying.jobs_of([3], 1, None)[2]
    assert job[1:2] == ("response",) and job[2].name == "idle to walk"
    (told,) = trying.figures_of(shipped, [job])
    assert told["seed"] == 3 and told["reached"] == 1 and 0.1 < told["idle_to_walk_s"] < 5
    assert told["updates"]["idle"][0] > 0 and len(told["gating"]["idle"][0]) == 8
    nowhere = replace(job[2], start=np.array((np.nan, 0.0)), name="walk to sit", piece=None)
    (broken,) = trying.figures_of(shipped, [(3, "sit", nowhere)])
    assert broken["reached"] == 0 and broken["error"]


def trial(seed: int, part: str, **figures):
    gating = {"walk": [[0.5, 0.5, 0.0], [0.0, 0.4, 0.6]]}
    shown = {"slid": {"walk": [1.0 + seed, 10.0]}, "updates": {"walk": [50.0, 10]}, "gating": gating}
    return {"seed": seed, "part": part, "name": "some", "reached": 1.0, **shown, **figures}


RESULTS = {
    key: {
        "title": key, "parameters": 12_500_000, "minutes": 20.0, "steps": 4000, "validation": 0.5,
        "trials": [
            trial(0, "sit", network_pe_cm=2.0, network_re_deg=1.0, pe_cm=None),
            trial(0, "sit", network_pe_cm=4.0, network_re_deg=None, reached=0.0),
            trial(1, "sit", network_pe_cm=5.0),
            trial(0, "response", idle_to_walk_s=1.25),
        ],
    }
    for key in ("nsm", "mlp", "concatenated")
}  # fmt: skip


def test_means_are_of_seeds_and_their_spread_beside_the_paper():
    text = tables.tables(RESULTS)
    assert "| NSM | 4.00 ± 1.00 (2.93) | 1.00 ± 0.00 (0.92) | 75 ± 25 |" in text
    assert "| MLP | 1.25 ± 0.00 (1.75) | - (1.35) | - (5.05) | - (5.13) | 100 ± 0 |" in text
    assert "| NSM | 12.50 | 20 | 4000 | 0.500 |" in text and "PFNN" not in text


def test_figures_are_drawn_of_what_there_is(tmp_path):
    made = draw_figures(RESULTS, tmp_path)
    assert [p.name[:9] for p in made] == ["figure_7_", "figure_10", "figure_11", "figure_12"]
    assert all(p.read_bytes()[:4] == b"\x89PNG" for p in made)
    assert draw_figures({}, tmp_path) == []


def test_the_command_writes_tables_of_what_has_been_judged(tmp_path, folder, capsys):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "mlp.json").write_text(json.dumps(RESULTS["mlp"]))
    given = ["nowhere", "--run", str(tmp_path), "--data", str(folder), "--no-training", "--only", "mlp,pfnn"]
    assert rivals.main(given) == 0
    text = (tmp_path / "tables.md").read_text(encoding="utf-8")
    assert "| MLP | 4.00 ± 1.00 (14.05)" in text and text in capsys.readouterr().out + "\n"
    assert (tmp_path / "figure_10_foot_sliding.png").exists()
    with pytest.raises(SystemExit):
        rivals.main([*given[:-1], "gru"])
