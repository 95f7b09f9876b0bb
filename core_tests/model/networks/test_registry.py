"""A second network, with memory, takes the NSM's road: registered, saved, loaded, stepped through takes, in
both back ends.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from fuzzing import one_sentence
from random_weights import LAYOUT, random_arrays
from recurrent import ELMAN, ElmanConfig

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.errors import WeightsError
from nsm_core.evaluation.report import Blind
from nsm_core.model.features.layout import INPUT, Inputs
from nsm_core.model.inference.model import BUNDLED, load_model
from nsm_core.model.inference.weights_file import load_weights, save_weights
from nsm_core.model.networks.registry import KINDS
from nsm_core.world.geometry.distance import Cuboids

FRAMES = 40


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setitem(KINDS, "elman", ELMAN)


class Heard:
    """A network whose steps are listened to: inputs, memory before and after, and outputs of each."""

    def __init__(self, model):
        self.model, self.backend, self.config, self.metadata, self.steps = (
            model,
            model.backend,
            model.config,
            model.metadata,
            [],
        )

    def start(self, batch=1):
        return self.model.start(batch)

    def step(self, inputs, memory):
        y, after, info = self.model.step(inputs, memory)
        self.steps.append((inputs, memory, after, y))
        return y, after, info


def walk(model, frames=FRAMES):
    """The runner of a short walk with no one else about, so many frames long."""
    runner = TakeRunner(
        model,
        TakeRequest(np.zeros(2), 0.0, [Goal("walk", "there", np.array((0.3, -3.0, 0.0)), 0.0)], Cuboids([])),
    )
    while runner.frames < frames + 1 and runner.step():
        pass
    return runner


@pytest.fixture(scope="module")
def shipped() -> Heard:
    """The shipped network, listened to on a walk."""
    heard = Heard(load_model(backend="numpy"))
    walk(heard)
    assert len(heard.steps) == FRAMES
    return heard


@pytest.fixture(scope="module")
def take(shipped) -> Inputs:
    """Inputs (T, ...) of that walk."""
    return Inputs(
        *(np.concatenate(rows) for rows in zip(*(inputs for inputs, *_ in shipped.steps), strict=True))
    )


@pytest.fixture(scope="module")
def saved(tmp_path_factory, shipped):
    """Path of its weights file: random parameters, outputs about those of the walk, so that a take can be
    made of them.
    """
    parameters, statistics = random_arrays(ElmanConfig())
    y = np.concatenate([y for *_, y in shipped.steps])
    statistics |= {"output_mean": y.mean(axis=0), "output_std": np.maximum(0.1 * y.std(axis=0), 1e-4)}
    path = tmp_path_factory.mktemp("elman") / "elman.npz"
    return save_weights(
        path, parameters, statistics, config=ElmanConfig(), layout=LAYOUT, stance=shipped.metadata["stance"]
    )


def through(model, take: Inputs, memory=None):
    """Outputs (T, B, N) of B equal characters stepped through a take's inputs, and the memory after it."""
    batch = 1 if memory is None else len(next(iter(memory.values())))
    memory, outputs = model.start() if memory is None else memory, []
    for x, gating in zip(*take, strict=True):
        y, memory, info = model.step(Inputs(np.tile(x, (batch, 1)), np.tile(gating, (batch, 1))), memory)
        assert info == {}
        outputs.append(y)
    return np.stack(outputs), memory


def test_a_weights_file_says_which_network_it_holds(saved):
    assert load_weights(saved).network == load_weights(saved).metadata["network"] == "elman"
    model = load_model(saved)
    assert isinstance(model, ELMAN.numpy) and model.config == ElmanConfig()


def test_the_shipped_file_is_the_nsm_and_one_that_does_not_say_is_too(tmp_path):
    assert load_weights(BUNDLED).metadata["network"] == load_model().config.network == "nsm"
    with np.load(BUNDLED) as archive:
        entries = dict(archive)
    metadata = {k: v for k, v in json.loads(entries["metadata"].tobytes()).items() if k != "network"}
    entries["metadata"] = np.frombuffer(json.dumps(metadata).encode(), np.uint8)
    np.savez(tmp_path / "older.npz", **entries)
    assert load_model(tmp_path / "older.npz").config.network == "nsm"


@pytest.mark.parametrize("name", ["gru", "", 5, ["nsm"], None, "x" * 5000])
def test_an_unknown_network_is_refused_in_one_sentence(saved, tmp_path, name):
    with np.load(saved) as archive:
        entries = dict(archive)
    metadata = json.loads(entries["metadata"].tobytes()) | {"network": name}
    entries["metadata"] = np.frombuffer(json.dumps(metadata).encode(), np.uint8)
    np.savez(tmp_path / "other.npz", **entries)
    for read in (load_weights, load_model):
        with pytest.raises(WeightsError) as caught:
            read(tmp_path / "other.npz")
        assert f"knows {', '.join(KINDS)}; update the program" in one_sentence(caught)


def test_files_do_not_pass_for_another_network(saved, tmp_path):
    with np.load(saved) as archive:
        entries = dict(archive)
    metadata = json.loads(entries["metadata"].tobytes())
    del metadata["network"]
    entries["metadata"] = np.frombuffer(json.dumps(metadata).encode(), np.uint8)
    np.savez(tmp_path / "other.npz", **entries)
    with pytest.raises(WeightsError) as caught:
        load_model(tmp_path / "other.npz")
    assert "encoders.0.layers.0.weight is missing" in one_sentence(caught)


def test_what_it_remembers_counts_and_belongs_to_who_steps(saved, take):
    model = load_model(saved)
    outputs, memory = through(model, take)
    again, _ = through(model, take)
    np.testing.assert_array_equal(outputs, again)  # nothing is left in the network
    assert memory["frames"] == FRAMES
    alone, _, _ = model.step(Inputs(take.features[-1:], take.gating[-1:]), model.start())
    assert np.abs(alone - outputs[-1]).max() > 0.1 * model._s["output_std"].min()
    half = Inputs(take.features[: FRAMES // 2], take.gating[: FRAMES // 2])
    rest = Inputs(take.features[FRAMES // 2 :], take.gating[FRAMES // 2 :])
    np.testing.assert_array_equal(through(model, rest, through(model, half)[1])[0], outputs[FRAMES // 2 :])


def test_a_take_is_a_batch_of_one(saved, take):
    """Characters stepped together do as each does by itself, one that begins later among them."""
    model = load_model(saved)
    first, memory = through(model, Inputs(take.features[:10], take.gating[:10]))
    both = {name: np.concatenate((values, model.start()[name])) for name, values in memory.items()}
    rest = Inputs(take.features[10:], take.gating[10:])
    together, _ = through(model, rest, both)
    scale = model._s["output_std"]
    np.testing.assert_allclose(
        together[:, 0] / scale, through(model, rest, memory)[0][:, 0] / scale, atol=1e-3
    )
    np.testing.assert_allclose(together[:, 1] / scale, through(model, rest)[0][:, 0] / scale, atol=1e-3)


def test_back_ends_agree_over_a_take(saved, take):
    pytest.importorskip("torch")
    (ours, mine), (theirs, other) = (
        through(load_model(saved, backend), take) for backend in ("numpy", "torch")
    )
    scale = load_weights(saved).statistics["output_std"]
    np.testing.assert_allclose(ours / scale, theirs / scale, atol=1e-3)
    np.testing.assert_allclose(mine["hidden"], other["hidden"], atol=1e-4)
    assert theirs.dtype == other["hidden"].dtype == np.float32


def test_memory_of_another_shape_is_refused(saved, take):
    model = load_model(saved)
    for memory in ({}, model.start(2), load_model().start()):
        with pytest.raises(ValueError, match="step needs the memory"):
            model.step(Inputs(take.features[:1], take.gating[:1]), memory)


def test_takes_carry_the_memory_along(saved):
    heard = Heard(load_model(saved))
    runner = walk(heard)
    assert runner.frames == FRAMES + 1 and runner.result().experts.shape == (FRAMES + 1, 0)
    assert [int(memory["frames"][0, 0]) for _, memory, *_ in heard.steps] == list(range(FRAMES))
    for (*_, after, _), (_, before, *_) in zip(heard.steps, heard.steps[1:], strict=False):
        assert all(np.array_equal(before[name], after[name]) for name in after)
    again, _ = through(
        heard.model, Inputs(*(np.concatenate(v) for v in zip(*(s[0] for s in heard.steps), strict=True)))
    )
    np.testing.assert_array_equal(again, np.stack([y for *_, y in heard.steps]))


def test_sensors_can_be_taken_from_it_as_from_any(saved, take):
    model = load_model(saved)
    blind = Blind(model, "environment")
    features = np.random.default_rng(0).normal(size=take.features[:1].shape).astype(np.float32)
    emptied = features.copy()
    emptied[:, INPUT.slices["environment"]] = 0
    gating = take.gating[:1]
    y, memory, _ = blind.step(Inputs(features, gating), blind.start())
    np.testing.assert_array_equal(y, model.step(Inputs(emptied, gating), model.start())[0])
    assert memory["frames"] == 1 and (features[:, INPUT.slices["environment"]] != 0).all()


@pytest.mark.parametrize("name", list(KINDS))
def test_a_narrower_network_reads_and_tells_the_same_with_fewer_weights(name):
    config = KINDS[name].config()
    narrow = config.narrowed(0.5)
    assert narrow.widths == config.widths and type(narrow) is type(config)
    assert getattr(narrow, "experts", 0) == getattr(config, "experts", 0)
    sizes = [sum(int(np.prod(s)) for s in c.parameter_shapes().values()) for c in (narrow, config)]
    assert 0.2 < sizes[0] / sizes[1] < 0.6
    assert config.narrowed(1.0) == config
