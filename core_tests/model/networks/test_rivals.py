"""The networks of the comparison: alike in size, in numpy as in torch, each gated by what it says."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from random_weights import random_arrays

torch = pytest.importorskip("torch")

from nsm_core.body.skeleton import INDEX
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.model.features.codec import SensorReading, build_inputs
from nsm_core.model.features.layout import FRAME, GATING, INPUT, Inputs
from nsm_core.model.features.state import PIVOT, State
from nsm_core.model.inference.model import load_model
from nsm_core.model.inference.torch_model import TorchModel
from nsm_core.model.networks import gate_features
from nsm_core.model.networks.config import STATISTICS
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.registry import KINDS
from nsm_core.world.geometry.distance import Cuboids

SMALL = {
    "encoder_frame": 12, "encoder_goal": 6, "encoder_environment": 8, "encoder_interaction": 7,
    "encoder_gating": 5, "gating_hidden": 9, "hidden": 14,
}  # fmt: skip
EVERY = pytest.mark.parametrize("name", list(KINDS))


def small(name: str):
    kind = KINDS[name].config
    return kind(**{k: v for k, v in SMALL.items() if k in {f.name for f in fields(kind)}})


def drawn_state(count: int = 3, seed: int = 0) -> State:
    """Characters whose labels, phases, goals and bodies are all drawn."""
    rng = np.random.default_rng(seed)

    def values(*shape):
        return rng.normal(size=(count, *shape)).astype(np.float32)

    def share(*shape):
        return rng.random((count, *shape)).astype(np.float32)

    body = [values(23, 3) for _ in range(4)]
    past = (values(31, 3), share(31, 7), share(31))
    return State(*body, *past, values(6, 3), share(6, 7), share(6), values(13, 3), values(13), share(13, 6))


def inputs_of(state: State, seed: int = 1) -> Inputs:
    rng, n = np.random.default_rng(seed), len(state)
    around = SensorReading(rng.random((n, 1408)), rng.normal(size=(n, 512, 3)), rng.random((n, 512)))
    return build_inputs(state, around)


def weights_of(name: str, seed: int = 0) -> Weights:
    return Weights(*random_arrays(small(name), seed), load_model(backend="numpy").metadata)


@EVERY
def test_sizes_are_alike(name):
    count, nsm = (
        sum(math.prod(shape) for shape in KINDS[n].config().parameter_shapes().values())
        for n in (name, "nsm")
    )
    assert abs(count / nsm - 1) < 0.01


@EVERY
@pytest.mark.parametrize("count", [1, 3, 12])
def test_numpy_steps_as_the_torch_module(name, count):
    kind, config, weights = KINDS[name], small(name), weights_of(name)
    ours, theirs = kind.numpy(config, weights), TorchModel(kind, config, weights)
    mine, other = ours.start(count), theirs.start(count)
    assert {k: v.shape for k, v in mine.items()} == {k: (count, s) for k, s in config.memory_sizes.items()}
    for frame in range(3):
        inputs = inputs_of(drawn_state(count, frame))
        y, mine, info = ours.step(inputs, mine)
        expected, other, told = theirs.step(inputs, other)
        scale = weights.statistics["output_std"]
        np.testing.assert_allclose(y / scale, expected / scale, atol=2e-4)
        assert y.dtype == np.float32 and info.keys() == told.keys() == config.info_sizes.keys()
        for name_ in mine:
            np.testing.assert_allclose(mine[name_], other[name_], atol=1e-4)
        for name_ in info:
            np.testing.assert_allclose(info[name_], told[name_], atol=1e-4)
            np.testing.assert_allclose(info[name_].sum(axis=1), 1, atol=1e-4)


@EVERY
def test_the_module_has_the_parameters_that_its_sizes_tell(name):
    net = KINDS[name].module(small(name))
    assert {k: tuple(v.shape) for k, v in net.named_parameters()} == small(name).parameter_shapes()


@EVERY
def test_the_controller_steps_it(name):
    model = KINDS[name].numpy(small(name), weights_of(name))
    goal = Goal("walk", "there", np.array((0.3, -3.0, 0.0)), 0.0)
    runner = TakeRunner(model, TakeRequest(np.zeros(2), 0.0, [goal], Cuboids([])))
    before = runner.memory
    assert runner.step() and runner.step() and runner.frames == 3
    assert all(np.abs(runner.memory[k] - before[k]).max() > 0 for k in before)


@EVERY
def test_new_statistics_do_not_change_what_it_computes(name):
    torch.manual_seed(0)
    net, rng = KINDS[name].module(small(name)), np.random.default_rng(0)

    def statistics():
        return {
            k: np.exp(rng.normal(0, 0.2, len(getattr(net, k))))
            if k.endswith("_std")
            else rng.normal(0, 0.3, len(getattr(net, k)))
            for k in STATISTICS
        }

    net.set_statistics(**statistics())
    inputs = Inputs(*(torch.from_numpy(v) for v in inputs_of(drawn_state())))
    with torch.no_grad():
        before = net.step(inputs, net.start(3))[0]
        old = {k: getattr(net, k).clone() for k in STATISTICS}
        net.set_statistics(**statistics())
        assert (net.step(inputs, net.start(3))[0] - before).abs().max() > 0.1
        net.renormalise(old)
        after = net.step(inputs, net.start(3))[0]
    np.testing.assert_allclose(after, before, atol=2e-3 * float(before.abs().max()))


def test_a_recurrent_network_answers_by_what_it_has_seen():
    model = KINDS["lstm"].numpy(small("lstm"), weights_of("lstm"))
    first, second = inputs_of(drawn_state(seed=4)), inputs_of(drawn_state(seed=5))
    _, memory, _ = model.step(first, model.start(3))
    fresh, told = model.step(second, model.start(3))[0], model.step(second, memory)[0]
    assert np.abs(fresh - told).max() > 1e-3


def test_the_phase_is_told_from_the_inputs():
    state = drawn_state(20)
    inputs = inputs_of(state)
    wave = gate_features.waves(*inputs)
    angle = 2 * np.pi * state.phase_keys()
    np.testing.assert_allclose(wave, np.stack((np.sin(angle), np.cos(angle)), -1), atol=1e-5)
    told = gate_features.phases(np, *inputs)
    away = (told / (2 * np.pi) - state.phase_keys()[:, PIVOT] + 0.5) % 1 - 0.5
    assert np.abs(away).max() < 1e-5


def test_what_is_concatenated_is_what_the_phase_modulates():
    inputs = inputs_of(drawn_state(20))
    side = gate_features.concatenated(np, *inputs).reshape(20, 13, gate_features.PER_KEY)
    product = side[:, :, 2:, None] * side[:, :, None, :2]
    np.testing.assert_allclose(product.reshape(20, GATING.size), inputs.gating, atol=1e-4)


def test_the_spline_goes_through_its_points_and_bends_as_holden_says():
    points = np.arange(4)
    np.testing.assert_allclose(
        gate_features.catmull_rom(np, points * np.pi / 2, points), np.eye(4), atol=1e-12
    )
    rng = np.random.default_rng(0)
    a, phase = rng.normal(size=4), rng.uniform(-np.pi, 3 * np.pi, 50)
    found = gate_features.catmull_rom(np, phase, points) @ a
    for p, value in zip(phase, found, strict=True):
        t = 4 * p / (2 * np.pi)
        k, w = math.floor(t), t % 1
        a0, a1, a2, a3 = (a[(k + n) % 4] for n in (-1, 0, 1, 2))
        expected = (
            a1 + w * (a2 / 2 - a0 / 2) + w**2 * (a0 - 2.5 * a1 + 2 * a2 - a3 / 2)
            + w**3 * (1.5 * a1 - 1.5 * a2 + a3 / 2 - a0 / 2)
        )  # fmt: skip
        assert value == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "told"),
    [("mann", "velocity"), ("nsm", "gating"), ("pfnn", "phase"), ("nsm_concatenated", "gating")],
)
def test_weights_are_blended_by_what_each_gate_reads(name, told):
    model, state = KINDS[name].numpy(small(name), weights_of(name)), drawn_state()

    def blend(changed: State):
        return model.step(inputs_of(changed), model.start(3))[2]["experts"]

    def change(**values):
        return State(**{f.name: getattr(state, f.name) for f in fields(State)} | values)

    feet = state.joint_velocity.copy()
    feet[:, INDEX["LeftToe"]] += 1.0
    phase = state.phase_past.copy()
    phase[:, -1] += 0.2
    changes = {
        "velocity": change(joint_velocity=feet),
        "phase": change(phase_past=phase),
        "goal": change(goal_action=1 - state.goal_action),
    }
    moved = {k: np.abs(blend(s) - blend(state)).max() > 1e-3 for k, s in changes.items()}
    expected = {"velocity": {"velocity"}, "phase": {"phase"}, "gating": {"phase", "goal"}}[told]
    assert {k for k, m in moved.items() if m} == expected


@pytest.mark.parametrize(
    ("name", "part"),
    [(n, p) for n in KINDS for p in ("environment", "interaction")]
    + [(n, p) for n in ("nsm", "nsm_concatenated") for p in gate_features.GATE_PARTS],
)
def test_a_blind_network_never_learns_to_see(name, part):
    torch.manual_seed(0)
    net = KINDS[name].module(small(name))
    net.blind(part)
    optimiser = torch.optim.AdamW(net.parameters(), lr=0.01)
    inputs = Inputs(*(torch.from_numpy(v) for v in inputs_of(drawn_state())))
    for _ in range(3):
        optimiser.zero_grad()
        net(net.normalised(inputs), net.start(3))[0].square().mean().backward()
        optimiser.step()
    weight, columns = net.reader(part)
    assert not weight[:, columns].any()
    if part in INPUT.slices:
        x = inputs.features.clone()
        x[:, INPUT.slices[part]] += 1.0
        with torch.no_grad():
            seen, unseen = (net.step(Inputs(v, inputs.gating), net.start(3))[0] for v in (inputs.features, x))
        assert torch.equal(seen, unseen)
    else:
        kept = np.setdiff1d(np.arange(weight.shape[1]), columns)
        assert weight[:, kept].abs().min() > 0


def test_the_parts_of_a_gate_are_where_they_are_said_to_be():
    state = drawn_state()
    far = State(**{f.name: getattr(state, f.name) for f in fields(State)})
    far.goal_position = state.goal_position + np.array((1.0, 0.0, 0.0), np.float32)
    one, other = inputs_of(state), inputs_of(far)
    found = np.flatnonzero(np.abs(one.gating - other.gating).max(axis=0) > 1e-5)
    assert len(found) and np.isin(found, gate_features.modulated_columns("gate_distances")).all()
    plain = [gate_features.concatenated(np, *i) for i in (one, other)]
    found = np.flatnonzero(np.abs(plain[0] - plain[1]).max(axis=0) > 1e-4)
    assert len(found) and np.isin(found, gate_features.plain_columns("gate_distances")).all()
    velocity = FRAME.get(one.features[:, : FRAME.size], "joint_velocity")
    np.testing.assert_array_equal(
        one.features[:, gate_features.FOOT_VELOCITIES].reshape(3, 4, 3),
        velocity[:, [INDEX[n] for n in ("RightAnkle", "RightToe", "LeftAnkle", "LeftToe")]],
    )
