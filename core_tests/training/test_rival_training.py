"""Training for comparison: one step instead of roll-outs, teacher forcing, blindness, blending, minutes."""

from __future__ import annotations

import time
from dataclasses import replace

import captures
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from small_nsm import prepared

from nsm_core.data.storage import Dataset
from nsm_core.model.features.codec import build_targets, read_outputs
from nsm_core.model.features.layout import INPUT, Inputs
from nsm_core.model.features.rollout_step import BLENDINGS, advance
from nsm_core.model.inference.model import load_model
from nsm_core.model.networks.lstm_config import AutoLstmConfig, LstmConfig
from nsm_core.model.networks.mlp_config import MlpConfig
from nsm_core.training.batches import Batches, RolloutSettings
from nsm_core.training.log import Log
from nsm_core.training.loop import run_training
from nsm_core.training.measured_phase import with_measured_phase
from nsm_core.training.trainer import Trainer, TrainingSettings

SIZES = {
    "encoder_frame": 16, "encoder_goal": 8, "encoder_environment": 8, "encoder_interaction": 8,
    "encoder_gating": 8, "hidden": 16,
}  # fmt: skip
SETTINGS = TrainingSettings(steps=8, data_batch=16, pool=16, learning_rate=1e-2, averaging=0.5, window=4)


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Dataset:
    return captures.dataset(captures.data_folder(tmp_path_factory))


def trainer_of(data: Dataset, config, **settings) -> Trainer:
    return prepared(Trainer(data, replace(SETTINGS, **settings), config))


def batches_of(data, pool: int = 32, **settings) -> Batches:
    return Batches(data, data.frames, np.random.default_rng(2), pool, RolloutSettings(**settings))


def true_outputs(batches: Batches, data: Dataset):
    frames = batches.pool_frames
    return build_targets(batches.pool_state, data.state(frames + 1), data.arrays["contact"][frames + 1])


def off_the_data(batches: Batches, data: Dataset) -> np.ndarray:
    """How far (P,) the pool's joints are from those of the data, metres."""
    true = data.state(batches.pool_frames)
    return np.abs(batches.pool_state.joint_position - true.joint_position).max(axis=(1, 2))


@pytest.mark.parametrize(("teacher", "share"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)])
def test_a_teacher_puts_its_share_of_frames_back(data, teacher, share):
    batches = batches_of(data, 400, teacher=teacher)
    batches.from_pool()
    batches.step_pool(true_outputs(batches, data) + np.float32(0.01))
    going = batches.pool_age > 0
    back = off_the_data(batches, data)[going] < 1e-5
    assert going.sum() > 200 and abs(back.mean() - share) < 0.1


def test_one_step_training_never_sees_its_own_frames(data):
    batches = Batches(data, data.frames, np.random.default_rng(2), 32, RolloutSettings.one_step())
    for _ in range(3):
        batches.from_pool()
        batches.step_pool(true_outputs(batches, data) + np.float32(0.05))
        assert off_the_data(batches, data).max() == 0 and not batches.pool_age.any()


def test_roll_outs_are_stepped_by_the_blending_that_is_asked_for(data):
    velocities = {}
    for name, blending in BLENDINGS.items():
        batches = batches_of(data, blending=blending)
        batches.from_pool()
        outputs = true_outputs(batches, data) + np.float32(0.02)
        state = advance(batches.pool_state, read_outputs(outputs, batches.pool_state), blending)
        batches.step_pool(outputs)
        on = batches.pool_age > 0
        velocities[name] = batches.pool_state.joint_velocity[on], batches.pool_state.root_future[on]
        np.testing.assert_array_equal(velocities[name][0], state.joint_velocity[on])
        np.testing.assert_array_equal(velocities[name][1], state.root_future[on])
    same = {
        (a, b): tuple(np.array_equal(x, y) for x, y in zip(velocities[a], velocities[b], strict=True))
        for a, b in (("both", "none"), ("both", "pose"), ("both", "trajectory"))
    }
    assert same == {
        ("both", "none"): (False, False),
        ("both", "pose"): (True, False),
        ("both", "trajectory"): (False, True),
    }


@pytest.mark.parametrize("config", [MlpConfig(**SIZES), LstmConfig(**SIZES), AutoLstmConfig(**SIZES)])
def test_it_trains_is_kept_and_steps(data, config, tmp_path):
    trainer = trainer_of(data, config, without=("environment",))
    before = {name: p.detach().clone() for name, p in trainer.net.named_parameters()}
    losses = np.array([trainer.train_step() for _ in range(6)])
    assert np.isfinite(losses).all()
    # All learn but what would read the environment.
    idle = {name for name, p in trainer.net.named_parameters() if not p.grad.any()}
    assert {name.rpartition(".")[0] for name in idle} <= {"encoders.2.layers.0"}
    assert all((p != before[name]).any() for name, p in trainer.net.named_parameters() if name not in idle)
    assert trainer.batches.settings.teacher == config.teacher == (0.5 if config.network == "auto_lstm" else 0)
    model = load_model(trainer.export(tmp_path / "some.npz"))
    assert model.config == config and model.metadata["training"]["without"] == ["environment"]
    x, g, _ = trainer.batches.from_data(trainer.batches.draw(3))
    changed = x.copy()
    changed[:, INPUT.slices["environment"]] += 1
    seen, unseen = (model.step(Inputs(v, g), model.start(3))[0] for v in (x, changed))
    np.testing.assert_array_equal(seen, unseen)


def test_minutes_end_a_training_and_go_on_with_what_is_left(data, tmp_path):
    trainer = trainer_of(data, MlpConfig(**SIZES), steps=10**6, minutes=1.0)
    trainer.spend(15.0)
    trainer.train_step()
    trainer.spend(15.0)
    assert trainer.spent == 30.0 and trainer.total == 2  # half the time for a step
    trainer.save(tmp_path / "checkpoint.pt")
    other = trainer_of(data, MlpConfig(**SIZES), steps=10**6, minutes=1.0)
    other.load(tmp_path / "checkpoint.pt")
    assert other.spent == 30.0 and other.total == 2
    other.spend(29.9)
    began, log = time.monotonic(), Log(tmp_path / "log.csv")
    log.begin(other.step)
    run_training(other, tmp_path / "checkpoint.pt", log)
    assert other.step == other.total > 1 and other.spent >= 60.0 > other.spent - (time.monotonic() - began)
    again = trainer_of(data, MlpConfig(**SIZES), steps=10**6, minutes=1.0)
    again.load(tmp_path / "checkpoint.pt")
    assert again.total == again.step == other.step


def test_a_measured_phase_grows_in_every_take(data):
    torch.manual_seed(0)
    measured = with_measured_phase(data, minutes=1.0, most=20)
    a, phase = data.arrays, measured.arrays["phase"]
    assert phase.shape == a["phase"].shape and not np.array_equal(phase, a["phase"])
    within = a["start"][1:] == a["start"][:-1]
    assert (np.diff(phase)[within] > 0).all()
    assert all(measured.arrays[k] is v for k, v in a.items() if k != "phase")
