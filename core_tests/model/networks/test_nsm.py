"""The torch module: gradients of the hand-written layer, statistics, and that it learns."""

from __future__ import annotations

import copy

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from nsm_core.model.features.layout import GATING, INPUT, OUTPUT, Inputs
from nsm_core.model.inference.model import model_of
from nsm_core.model.inference.weights_file import load_weights, save_weights
from nsm_core.model.networks.config import STATISTICS
from nsm_core.model.networks.nsm import NSM, ExpertLinear
from nsm_core.model.networks.nsm_config import NsmConfig


@pytest.fixture
def net(small_config):
    torch.manual_seed(0)
    return NSM(small_config)


def forward(net, x, g):
    """Normalised outputs and coefficients of normalised inputs."""
    y, memory, info = net(Inputs(x, g), net.start(len(x)))
    assert memory == {}
    return y, info["experts"]


def test_defaults_are_the_sizes_of_the_features():
    config = NsmConfig()
    assert config.parts == tuple(block.stop - block.start for block in INPUT.slices.values())
    assert list(INPUT.slices) == ["frame", "goal", "environment", "interaction"]
    assert (config.inputs, config.gating, config.outputs) == (INPUT.size, GATING.size, OUTPUT.size)
    assert NsmConfig.from_dict(config.to_dict() | {"of_a_later_version": 1}) == config


def test_expert_layer_gradients_against_finite_differences():
    torch.manual_seed(1)
    layer = ExpertLinear(3, 5, 4).double()
    x = torch.randn(6, 5, dtype=torch.float64, requires_grad=True)
    c = torch.rand(6, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda x, c, w: type(layer).forward(_with(layer, w), x, c), (x, c, layer.weight)
    )


def _with(layer, weight):
    other = ExpertLinear(3, 5, 4).double()
    del other.weight
    other.weight, other.bias = weight, layer.bias
    return other


def test_expert_layer_blends_weights_and_biases():
    torch.manual_seed(2)
    layer = ExpertLinear(3, 5, 4)
    torch.nn.init.normal_(layer.bias)
    x, c = torch.randn(6, 5), torch.softmax(torch.randn(6, 3), -1)
    for row in range(6):
        weight = sum(c[row, k] * layer.weight[k] for k in range(3))
        bias = sum(c[row, k] * layer.bias[k] for k in range(3))
        torch.testing.assert_close(layer(x, c)[row], weight @ x[row] + bias)


def test_state_names_and_shapes_are_those_of_the_weights_file(net, small_config):
    state = {name: tuple(values.shape) for name, values in net.state_dict().items()}
    assert state == small_config.shapes()


def test_signal_neither_vanishes_nor_explodes_at_the_start():
    torch.manual_seed(0)
    net = NSM()
    y, c = forward(net, torch.randn(64, net.config.inputs), torch.randn(64, net.config.gating))
    assert 0.05 < y.std() < 2
    assert c.max() < 0.5  # every expert takes part


def test_bfloat16_stays_near_single_precision(net, small_config):
    x, g = torch.randn(32, small_config.inputs), torch.randn(32, small_config.gating)
    exact, coefficients = forward(net, x, g)
    with torch.autocast("cpu", torch.bfloat16):
        y, c = forward(net, x, g)
    assert y.dtype == c.dtype == torch.float32
    assert (y - exact).abs().max() < 0.03 * exact.abs().max() + 0.02
    assert (c - coefficients).abs().max() < 0.02


def test_bfloat16_gradients_point_the_same_way(net, small_config):
    x, g, t = (
        torch.randn(64, small_config.inputs),
        torch.randn(64, small_config.gating),
        torch.randn(64, small_config.outputs),
    )

    def gradient(half):
        net.zero_grad()
        with torch.autocast("cpu", torch.bfloat16, enabled=half):
            loss = torch.nn.functional.mse_loss(forward(net, x, g)[0], t)
        loss.backward()
        assert all(p.grad.dtype == torch.float32 for p in net.parameters())
        return torch.cat([p.grad.flatten() for p in net.parameters()])

    assert torch.nn.functional.cosine_similarity(gradient(False), gradient(True), dim=0) > 0.99


def test_every_parameter_learns(net, small_config):
    y, _ = forward(net, torch.randn(16, small_config.inputs), torch.randn(16, small_config.gating))
    y.square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().max() > 0 for p in net.parameters())


def test_dropout_only_while_training(small_config):
    net = NSM(NsmConfig.from_dict(small_config.to_dict() | {"dropout": 0.5}))
    x, g = torch.randn(8, small_config.inputs), torch.randn(8, small_config.gating)
    assert not torch.equal(forward(net, x, g)[0], forward(net, x, g)[0])
    net.eval()
    assert torch.equal(forward(net, x, g)[0], forward(net, x, g)[0])


def test_statistics_are_floored_and_applied(net, small_config):
    std = np.ones(small_config.inputs)
    std[3] = 0
    net.set_statistics(floor=0.05, input_std=std, output_mean=np.full(small_config.outputs, 7.0))
    assert net.input_std[3] == pytest.approx(0.05) and net.input_std[0] == 1
    x, g = torch.randn(4, small_config.inputs), torch.randn(4, small_config.gating)
    scaled = x.clone()
    scaled[:, 3] *= 20
    torch.testing.assert_close(net.step(Inputs(x, g), {})[0], forward(net, scaled, g)[0] + 7)
    with pytest.raises(ValueError, match="output_std"):
        net.set_statistics(outputs_std=std)


def test_a_copy_follows_its_source(net, small_config):
    twin = copy.deepcopy(net)
    net.set_statistics(output_mean=np.linspace(0, 1, small_config.outputs))
    x, g = torch.randn(8, small_config.inputs), torch.randn(8, small_config.gating)
    with torch.no_grad():
        for p in net.parameters():
            p.add_(0.1)
        assert (net.step(Inputs(x, g), {})[0] - twin.step(Inputs(x, g), {})[0]).abs().max() > 0.05
        twin.refresh(net)
        torch.testing.assert_close(net.step(Inputs(x, g), {})[0], twin.step(Inputs(x, g), {})[0])


def test_it_learns_a_function_of_the_gating(net, small_config):
    """Two behaviours chosen by a gating feature: a single linear map cannot do it."""
    generator = torch.Generator().manual_seed(3)
    x = torch.randn(512, small_config.inputs, generator=generator)
    g = torch.randn(512, small_config.gating, generator=generator)
    target = torch.where(g[:, :1] > 0, x[:, :10], -x[:, :10])
    optimiser = torch.optim.AdamW(net.parameters(), lr=5e-3)
    losses = []
    for _ in range(250):
        with torch.autocast("cpu", torch.bfloat16):
            loss = torch.nn.functional.mse_loss(forward(net, x, g)[0], target)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < 0.3 * losses[0]


def test_saved_and_loaded_it_predicts_the_same(net, small_config, tmp_path):
    net.set_statistics(
        input_mean=np.linspace(-1, 1, small_config.inputs),
        output_std=np.linspace(0.1, 3, small_config.outputs),
    )
    state = {name: values.numpy() for name, values in net.state_dict().items()}
    save_weights(
        tmp_path / "w.npz",
        {k: v for k, v in state.items() if k not in STATISTICS},
        {k: state[k] for k in STATISTICS},
        config=small_config,
        layout={},
    )
    x = np.random.default_rng(0).normal(size=(3, small_config.inputs)).astype(np.float32)
    g = np.random.default_rng(1).normal(size=(3, small_config.gating)).astype(np.float32)
    y, _, _ = model_of(load_weights(tmp_path / "w.npz"), "numpy").step(Inputs(x, g), {})
    with torch.no_grad():
        expected = net.step(Inputs(torch.from_numpy(x), torch.from_numpy(g)), {})[0].numpy()
    # Half precision on disk keeps 11 bits of a parameter: 0.05 % each, and three layers of them.
    assert np.abs(y - expected).max() < 0.005 * np.abs(expected).max()
