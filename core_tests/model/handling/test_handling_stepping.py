"""The controller in numpy says what its torch module says, and leads a body along its key frames."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from handled import COUNT, handled, walked

from nsm_core.data.handling.library import HandlingLibrary
from nsm_core.errors import WeightsError
from nsm_core.evaluation.handling.rolled import captured_bodies, rolled_bodies
from nsm_core.evaluation.handling.table import curvature, judge
from nsm_core.model.handling.codec import build_inputs
from nsm_core.model.handling.layout import UNSEEN
from nsm_core.model.inference.handling_model import KALMAN, MATCHED, NONE, PREDICTED, load_handling
from nsm_core.model.networks.handling_config import HandlingConfig
from nsm_core.model.networks.handling_numpy import NumpyHandling
from nsm_core.model.networks.protocol import Weights
from nsm_core.training.handling import HandlingSettings, HandlingTrainer, learnt_phases
from nsm_core.training.timed_run import run

SMALL = HandlingConfig(hidden=24, experts=3, gate=8)
FEW = HandlingSettings(steps=12, batch=8, held_out=0.5)


def trainer(config: HandlingConfig = SMALL) -> HandlingTrainer:
    phase = walked().phase
    return HandlingTrainer(HandlingLibrary((handled(), handled(1.0))), [phase, phase], config, FEW)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("handling")
    made = trainer()
    run(made, folder, 60.0, lambda _: None)
    return made, made.export(folder / "controller.npz", ["nobody"])


@pytest.mark.parametrize("goal_phase", [0, 1])
def test_numpy_says_what_torch_says(goal_phase):
    made = trainer(HandlingConfig(hidden=24, experts=3, gate=8, goal_phase=goal_phase))
    made.learn()
    net = made.net.eval()
    frames = np.array((35, 60, 99))
    inputs = build_inputs(made.tracks.state(frames), made.tracks.goals(frames))
    with torch.no_grad():
        told = (net(torch.from_numpy(inputs)) * net.output_std + net.output_mean).numpy()
    statistics = {
        f"{n}_{k}": getattr(net, f"{n}_{k}").numpy() for n in ("input", "output") for k in ("mean", "std")
    }
    own = NumpyHandling(net.config, Weights(net.named(), statistics))
    assert np.allclose(own.outputs(inputs), told, atol=1e-4)
    assert np.allclose(own.outputs(inputs[:1]), told[:1], atol=1e-4)
    other = inputs.copy()
    other[:, UNSEEN] += 0.7
    assert np.allclose(own.outputs(other), told, atol=1e-4) == (goal_phase == 0)


def test_training_lessens_the_error_and_goes_on_from_a_checkpoint(tmp_path):
    made = trainer()
    first = made.judge()[0]
    for _ in range(60):
        made.learn()
    assert made.judge()[0] < first
    made.save(tmp_path / "checkpoint.pt")
    other = trainer()
    other.load(tmp_path / "checkpoint.pt")
    assert other.step == 60 and np.allclose(other.judge(), made.judge(), rtol=1e-4)  # sums differ by rounding
    with pytest.raises(WeightsError, match="another network"):
        trainer(HandlingConfig(hidden=16, experts=3, gate=8)).load(tmp_path / "checkpoint.pt")


def test_phases_are_learnt_once_and_kept(tmp_path):
    library, told = HandlingLibrary((handled(), handled(1.0))), []
    settings = HandlingSettings(held_out=0.5, phase_minutes=0.005)
    first = learnt_phases(library, tmp_path / "phases.npz", settings, told.append)
    assert len(told) == 2 and [p.shape for p in first] == [(COUNT, 3, 8)] * 2
    assert all((p >= 0).all() and (p[:, :2] <= 1).all() for p in first)
    again = learnt_phases(library, tmp_path / "phases.npz", settings, told.append)
    assert len(told) == 2 and np.array_equal(first[1], again[1])
    with pytest.raises(WeightsError, match="other performances"):
        learnt_phases(HandlingLibrary((handled(),)), tmp_path / "phases.npz", settings, told.append)


@pytest.mark.parametrize("goal_phase", [NONE, MATCHED, PREDICTED, KALMAN])
def test_it_leads_a_body_along_its_key_frames(trained, goal_phase):
    made, path = trained
    model = load_handling(path)
    assert model.config.keyframes == len(np.unique(made.tracks.key))
    (body,) = rolled_bodies(model, made.others, goal_phase)
    (data,) = captured_bodies(made.others)
    assert np.isfinite(body.positions).all()
    # As long as the reach takes in the performance, and no longer than it may.
    assert len(data.positions) == COUNT - 30
    assert len(data.positions) - 1 <= len(body.positions) <= len(data.positions) + 30
    assert [m.side for m in body.moves] == [m.side for m in data.moves] == [0, 0]
    assert np.isfinite(body.moves[0].missed) and np.isnan(body.moves[1].missed)


def test_what_is_judged_beside_itself_is_the_same(trained):
    data = captured_bodies(trained[0].others)
    judged = judge(data, data)
    assert judged.acceleration > 0 and judged.sliding > 0
    assert "|" in judged.row("data")


def test_a_circle_is_as_curved_as_its_radius():
    t = np.linspace(0, 2, 61)
    way = 0.2 * np.stack((np.cos(2 * t), np.sin(2 * t), 0 * t), axis=-1)
    assert np.isclose(curvature(way[5:-5]), 1 / 20, rtol=0.05)
    assert np.isnan(curvature(np.zeros((20, 3))))


def test_other_weights_are_refused(full_weights):
    with pytest.raises(WeightsError, match="another network"):
        load_handling(full_weights)
