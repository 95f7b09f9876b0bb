"""Training: it learns, it goes on where it stopped, and its roll-outs are led back to the takes as stated."""

from __future__ import annotations

import json
from dataclasses import replace

import captures
import numpy as np
import pytest
from fuzzing import one_sentence
from recurrent import ELMAN, ElmanConfig

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from small_nsm import CONFIG, prepared

from nsm_core.body.skeleton import FEET, INDEX
from nsm_core.conventions import STYLES
from nsm_core.data.scenarios.registry import drawn
from nsm_core.data.storage import Dataset, require_meaning
from nsm_core.errors import WeightsError
from nsm_core.model.features.codec import build_targets, read_outputs
from nsm_core.model.features.layout import GATING, INPUT, OUTPUT, Inputs
from nsm_core.model.features.meaning import meaning
from nsm_core.model.features.rollout_step import advance
from nsm_core.model.features.state import State
from nsm_core.model.inference.model import load_model
from nsm_core.model.networks.registry import KINDS
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.training.batches import Batches, RolloutSettings, loss_weights, statistics
from nsm_core.training.schedule import FLOOR, WARM_UP, cosine_restarts
from nsm_core.training.trainer import Trainer, TrainingSettings, device_of

SETTINGS = TrainingSettings(
    steps=90, data_batch=24, pool=24, learning_rate=1e-2, averaging=0.5, data_minutes=1.5, seed=4
)
STEPS = 90


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return captures.dataset(captures.data_folder(tmp_path_factory))


def trainer_of(data, seed_offset: int = 0) -> Trainer:
    trainer = Trainer(data, SETTINGS, CONFIG, seed_offset)
    # Statistics over fewer frames than a real run takes.
    prepared(trainer, 2000)
    return trainer


@pytest.fixture(scope="module")
def trained(data, tmp_path_factory) -> tuple[Trainer, list[float], np.ndarray]:
    """A trainer after a few steps, its loss on fixed frames before and after, the losses of its steps."""
    torch.set_num_threads(1)
    trainer = trainer_of(data)
    folder = captures.data_folder(tmp_path_factory)
    trainer.stance, trainer.meaning = (
        json.loads((folder / "data.json").read_text())["stance"],
        require_meaning(folder),
    )
    batch = trainer.batches.from_data(trainer.batches.draw(300))
    before = loss_of(trainer, batch)
    losses = np.array([trainer.train_step() for _ in range(STEPS)])
    return trainer, [before, loss_of(trainer, batch)], losses


def loss_of(trainer: Trainer, batch: tuple[np.ndarray, ...]) -> float:
    """Mean squared error of the averaged network in normalised units."""
    with torch.no_grad():
        out = trainer.average.step(Inputs(*(torch.from_numpy(b) for b in batch[:2])), {})[0]
    return float((((out - torch.from_numpy(batch[2])) / trainer.net.output_std) ** 2).mean())


def parameters(trainer: Trainer) -> dict[str, torch.Tensor]:
    return {f"{n}.{k}": v for n in ("net", "average") for k, v in getattr(trainer, n).state_dict().items()}


def test_a_few_steps_lower_the_loss(trained):
    trainer, (before, after), losses = trained
    assert trainer.step == STEPS and np.isfinite(losses).all()
    assert losses[-5:, 0].mean() < 0.8 * losses[:5, 0].mean()
    assert after < 0.8 * before
    assert 0 < trainer.validate(100) < 10


def test_a_checkpoint_goes_on_at_its_step_with_its_parameters(trained, data, tmp_path):
    trainer, _, _ = trained
    trainer.save(tmp_path / "checkpoint.pt")
    assert [p.name for p in tmp_path.iterdir()] == ["checkpoint.pt"]
    other = trainer_of(data, seed_offset=1)
    assert any(
        not torch.equal(a, b)
        for a, b in zip(parameters(other).values(), parameters(trainer).values(), strict=True)
    )
    other.load(tmp_path / "checkpoint.pt")
    assert other.step == trainer.step == STEPS
    for name, value in parameters(trainer).items():
        assert torch.equal(parameters(other)[name], value), name
    mine, theirs = other.optimiser.state_dict()["state"], trainer.optimiser.state_dict()["state"]
    assert mine.keys() == theirs.keys() and all(
        torch.equal(mine[k]["exp_avg_sq"], theirs[k]["exp_avg_sq"]) for k in mine
    )
    other.train_step()
    assert other.step == STEPS + 1
    moved = [
        not torch.equal(a, b) for a, b in zip(other.net.parameters(), trainer.net.parameters(), strict=True)
    ]
    assert all(moved)


def test_exported_weights_load_without_torch_and_predict_the_same(trained, tmp_path):
    trainer, _, _ = trained
    path = trainer.export(tmp_path / "nsm.npz")
    model = load_model(path, backend="numpy")
    x, g, _ = trainer.batches.from_data(trainer.batches.draw(16))
    y, _, info = model.step(Inputs(x, g), model.start(16))
    with torch.no_grad():
        expected, _, tensors = trainer.average.step(Inputs(torch.from_numpy(x), torch.from_numpy(g)), {})
    scale = trainer.net.output_std.numpy()
    # Half precision on disk costs some digits.
    np.testing.assert_allclose(y / scale, expected.numpy() / scale, atol=0.05)
    np.testing.assert_allclose(info["experts"], tensors["experts"].numpy(), atol=0.01)
    m = model.metadata
    assert (
        m["network"] == "nsm"
        and m["config"]["hidden"] == 48
        and m["training"]["steps_done"] == STEPS
        and m["training"]["seed"] == 4
    )
    assert m["seeds"] == {"data": 4, "training": 4} and {"idle", "walk"} <= set(m["actions"]) and m["credits"]
    assert m["actions"] == [name for name in STYLES if name in m["actions"]]
    assert np.shape(m["stance"]["local_rotations"]) == (23, 4) and 0.8 < m["stance"]["hips_height"] < 1.1
    assert "1.5 minutes" in m["data"] and m["meaning"] == meaning() | {"draws": drawn()}


CUDA = pytest.param("cuda", marks=pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device"))


@pytest.mark.parametrize("device", ["cpu", CUDA])
def test_a_network_with_memory_trains_and_remembers_each_roll_out(data, tmp_path, monkeypatch, device):
    monkeypatch.setitem(KINDS, "elman", ELMAN)
    settings = replace(SETTINGS, device=device, window=4, rollout=RolloutSettings(length=6))
    trainer = Trainer(data, settings, ElmanConfig())
    assert {p.device.type for p in trainer.net.parameters()} == {trainer.weights.device.type} == {device}
    prepared(trainer)
    rows, ages = settings.data_batch // 4, []
    for step in range(12):
        losses, age = trainer.train_step(), trainer.batches.pool_age
        frames, ages = trainer._memory["frames"][:, 0].detach().cpu().numpy(), [*ages, age.copy()]
        # The data's rows have gone through the window, but for those whose take ended in it.
        assert (
            len(frames) == rows + len(age) == 12 and frames[:rows].max() == 4 and (frames[:rows] >= 1).all()
        )
        if step > 1:  # by then every roll-out has begun under this trainer
            np.testing.assert_array_equal(frames[rows:][age > 0], age[age > 0])
    assert len(np.unique(ages)) == 6 and np.isfinite(losses).all() and np.isfinite(trainer.validate(50))
    trainer.save(tmp_path / "checkpoint.pt")
    trainer.load(tmp_path / "checkpoint.pt")
    assert load_model(trainer.export(tmp_path / "elman.npz")).config == ElmanConfig()


def delayed(data: Dataset, frames: int) -> Dataset:
    """The data with a coin in its goals, tossed anew at every frame, and a contact that shows how the one of
    ``frames`` frames ago fell: nothing in a frame's own input tells it.
    """
    coin = np.random.default_rng(8).random(len(data.arrays["end"])) < 0.5
    goals, contact = data.arrays["goal_action"].copy(), data.arrays["contact"].copy()
    goals[..., 0] = coin[:, None]
    contact[:, 0] = np.roll(coin, frames + 1)  # the target of a frame is the contact of the next
    return Dataset({**data.arrays, "goal_action": goals, "contact": contact}, data.frames)


def test_what_only_memory_can_know_is_learnt_through_the_window(data, monkeypatch):
    monkeypatch.setitem(KINDS, "elman", ELMAN)
    errors = {}
    for window in (1, 4):
        settings = replace(
            SETTINGS, data_batch=64, pool=16, window=window, noise=0.0, learning_rate=5e-3, steps=150
        )
        trainer = Trainer(delayed(data, 1), settings, ElmanConfig(recall=0.0))
        prepared(trainer)
        at = OUTPUT.slices["contact"].start
        trainer.weights = torch.zeros(OUTPUT.size)
        trainer.weights[at] = OUTPUT.size  # the loss is that of this one output: 1 for who does not know it
        errors[window] = np.mean([trainer.train_step() for _ in range(settings.steps)][-10:])
    assert errors[1] > 0.9, "one frame at a time teaches nothing to remember"
    assert errors[4] < 0.75


@pytest.mark.parametrize("device", ["abacus", "cuda:99", "meta"])
def test_a_device_that_cannot_be_used_is_refused_in_one_sentence(device):
    with pytest.raises(WeightsError, match=f"train on '{device}' here; choose cpu") as caught:
        device_of(device)
    one_sentence(caught)


def batches_of(data, pool: int = 64, **settings) -> Batches:
    return Batches(data, data.frames, np.random.default_rng(2), pool, RolloutSettings(**settings))


def drifted(state: State, shift: np.ndarray, turn: float) -> State:
    """A state carried off as one body: its pose and its present root moved by ``shift`` (2,) and turned about
    itself.
    """
    root = state.root

    def carry(p):
        moved = rotate_planar(p - np.pad(root[:, None, :2], ((0, 0), (0, 0), (0, 1))), np.float32(turn))
        moved[..., :2] += root[:, None, :2] + shift
        return moved.astype(np.float32)

    past = state.root_past.copy()
    past[:, -1] += np.append(shift, turn).astype(np.float32)
    axes = {
        k: rotate_planar(getattr(state, k), np.float32(turn))
        for k in ("joint_forward", "joint_up", "joint_velocity")
    }
    return replace(state, joint_position=carry(state.joint_position), root_past=past, **axes)


def test_without_drift_the_targets_are_those_of_the_data(data):
    batches = batches_of(data)
    state, following = data.state(batches.pool_frames), data.state(batches.pool_frames + 1)
    x, g, y = batches.from_pool()
    assert x.shape == (64, INPUT.size) and g.shape == (64, GATING.size)
    expected = build_targets(state, following, data.arrays["contact"][batches.pool_frames + 1])
    velocity = OUTPUT.slices["joint_velocity"]
    # Positions over a frame's time.
    np.testing.assert_allclose(y[:, velocity], expected[:, velocity], atol=2e-3)
    y[:, velocity] = expected[:, velocity] = 0
    np.testing.assert_allclose(y, expected, atol=1e-4)
    batches.step_pool(build_targets(state, following, data.arrays["contact"][batches.pool_frames + 1]))
    assert batches.drift.max() < 1e-4


@pytest.mark.parametrize("rate", [0.04, 0.2])
def test_a_drifted_root_is_led_back_by_the_stated_rate(data, rate):
    batches = batches_of(data, root_rate=rate)
    frames, shift, turn = batches.pool_frames, np.array((0.08, -0.05)), 0.1
    batches.pool_state = drifted(data.state(frames), shift, turn)
    following = data.state(frames + 1)
    read = read_outputs(batches.from_pool()[2], batches.pool_state)
    ahead = following.root_keys()[:, 6:]
    for k in range(7):
        left = (1 - rate) ** (1 + 5 * k)  # the drift that is left after as many frames
        np.testing.assert_allclose(
            read.root[:, k, :2] - ahead[:, k, :2], np.tile(left * shift, (64, 1)), atol=1e-4
        )
        np.testing.assert_allclose(wrap_angle(read.root[:, k, 2] - ahead[:, k, 2]), left * turn, atol=1e-4)
    np.testing.assert_allclose(read.root_goalward[..., :2], read.root[..., :2], atol=1e-4)


def test_a_wrong_pose_is_put_right_by_the_stated_rate(data):
    batches = batches_of(data, pose_rate=0.12)
    frames, head = batches.pool_frames, INDEX["Head"]
    state = data.state(frames)
    state.joint_position[:, head] += (0.05, 0.02, -0.03)
    batches.pool_state = state
    read = read_outputs(batches.from_pool()[2], state)
    off = read.joint_position - data.state(frames + 1).joint_position
    np.testing.assert_allclose(
        off[:, head], np.tile(0.88 * np.array((0.05, 0.02, -0.03)), (64, 1)), atol=1e-4
    )
    off[:, head] = 0
    assert np.abs(off).max() < 1e-4
    np.testing.assert_allclose(
        read.joint_velocity, (read.joint_position - state.joint_position) * 30, atol=3e-3
    )


def test_feet_that_stand_are_not_dragged_along(data):
    batches = batches_of(data, pool=256, root_rate=0.1, planted_rate=0.02)
    frames, shift = batches.pool_frames, np.array((0.1, 0.06))
    state = drifted(data.state(frames), shift, 0.0)
    batches.pool_state = state
    read = read_outputs(batches.from_pool()[2], state)
    contact = data.arrays["contact"]
    own = data.state(frames + 1).joint_position - data.state(frames).joint_position
    counted = 0
    for side, column in ((0, 3), (1, 4)):
        toe = FEET[side][3]
        pulled = np.linalg.norm((read.joint_position - state.joint_position - own)[:, toe, :2], axis=1)
        stands = (contact[frames, column] > 0.5) & (contact[frames + 1, column] > 0.5)
        counted += stands.sum()
        pull = 0.1 * np.linalg.norm(shift)  # what the root is pulled by
        np.testing.assert_allclose(pulled[stands], 0.02 * pull, atol=1e-4)
        np.testing.assert_allclose(pulled[~stands], pull, atol=2e-4)
    assert 50 < counted < 512


def test_roll_outs_end_where_they_are_worn_out(data):
    batches = batches_of(data, pool=8, length=5)
    batches.pool_age[:] = (0, 1, 2, 3, 4, 0, 0, 0)
    batches.pool_state = drifted(data.state(batches.pool_frames), np.zeros(2), 0.0)
    far = drifted(data.state(batches.pool_frames[[6]]), np.array((0.9, 0)), 0.0)
    batches.pool_state.assign(np.array([6]), far)
    was, y = batches.pool_frames.copy(), batches.from_pool()[2]
    stepped = advance(batches.pool_state, read_outputs(y, batches.pool_state))
    batches.step_pool(y)
    anew = np.array([False] * 4 + [True, False, True, False])
    ended = data.arrays["end"][was + 1] - (was + 1) <= 32
    np.testing.assert_array_equal(batches.pool_age, np.where(anew | ended, 0, (1, 2, 3, 4, 5, 1, 1, 1)))
    on = ~(anew | ended)
    np.testing.assert_array_equal(batches.pool_frames[on], was[on] + 1)
    np.testing.assert_array_equal(batches.pool_state.joint_position[on], stepped.joint_position[on])
    np.testing.assert_array_equal(batches.pool_state.root[anew], data.state(batches.pool_frames[anew]).root)
    np.testing.assert_array_equal(
        batches.pool_state.goal_position, data.arrays["goal_position"][batches.pool_frames]
    )


def test_frames_of_clips_that_are_kept_are_not_trained_on(data):
    some = np.zeros(len(data.arrays["end"]), bool)
    some[200:260] = some[900:1000] = True
    trainer = Trainer(Dataset({**data.arrays, "validates": some}, data.frames), SETTINGS, CONFIG)
    mine, kept = trainer.batches.frames, trainer.validation.frames
    assert not some[mine].any() and not some[mine + 1].any() and some[kept].all() and some[kept + 1].all()
    assert len(kept) > 100 and len(mine) > 0.8 * len(data.frames)
    # Roll-outs end where they would enter them.
    trainer.batches.pool_frames[:] = 198
    trainer.batches.pool_age[:] = 0
    trainer.batches.pool_state = data.state(trainer.batches.pool_frames)
    y = trainer.batches.from_pool()[2]
    trainer.batches.step_pool(y)
    assert not some[trainer.batches.pool_frames].any() and (trainer.batches.pool_frames != 199).all()


def test_where_no_clip_is_kept_the_last_take_validates(data):
    none = Dataset({**data.arrays, "validates": np.zeros(len(data.arrays["end"]), bool)}, data.frames)
    trainer = Trainer(none, SETTINGS, CONFIG)
    start = data.arrays["start"]
    mine, kept = set(start[trainer.batches.frames]), set(start[trainer.validation.frames])
    assert kept == {start[data.frames].max()} and mine | kept == set(start[data.frames]) and not mine & kept


def test_the_learning_rate_restarts_after_one_and_three_sevenths():
    total = 7000
    factors = np.array([cosine_restarts(s, total) for s in range(total)])
    rises = np.flatnonzero(np.diff(factors[WARM_UP:]) > 0) + WARM_UP + 1
    np.testing.assert_array_equal(rises, (1000, 3000))
    np.testing.assert_allclose(factors[[1000, 3000]], 1)
    np.testing.assert_allclose(factors[[999, 2999, 6999]], FLOOR, atol=1e-4)
    for first, length in ((1000, 2000), (3000, 4000)):
        assert factors[first + length // 2] == pytest.approx((1 + FLOOR) / 2, abs=1e-3)
    assert (np.diff(factors[:WARM_UP]) > 0).all() and factors[0] == pytest.approx(1 / WARM_UP, rel=0.01)
    assert 0 < cosine_restarts(total + 500, total) <= FLOOR + 1e-6


def test_statistics_and_weights_of_the_loss(data):
    batches = batches_of(data)
    stats = statistics(batches, 1000)
    widths = {"input": INPUT.size, "gating": GATING.size, "output": OUTPUT.size}
    for name, width in widths.items():
        assert (
            stats[f"{name}_mean"].shape == stats[f"{name}_std"].shape == (width,)
            and (stats[f"{name}_std"] > 0).all()
        )
    # A cell that was never hit is not blown up.
    assert np.ptp(stats["input_std"][INPUT.slices["environment"]]) == 0
    weights = loss_weights(feet=3.0)
    assert weights.mean() == pytest.approx(1, abs=1e-5)
    position = OUTPUT.get(weights[None], "joint_position")[0]
    np.testing.assert_allclose(position[INDEX["LeftToe"]] / position[INDEX["Head"]], 3, rtol=1e-5)


def test_sit_downs_are_drawn_more_often(data):
    drawn = batches_of(data).draw(20000)
    sit = data.arrays["style"][:, 5]
    moving = (sit > 0.02) & (sit < 0.98)
    share = moving[data.frames].mean()
    assert moving[drawn].mean() == pytest.approx(3 * share / (1 + 2 * share), abs=0.02)
