"""Transition networks: trained, written, read and stepped in numpy as they were in torch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gaps_of_walks import SMALL, SMALL_DELTA, walk, windows

torch = pytest.importorskip("torch")

from nsm_core.commands import transitions as command
from nsm_core.control.inbetween import Gap, fill
from nsm_core.data.transitions.gaps import GapSource, statistics_of
from nsm_core.errors import WeightsError
from nsm_core.model.inference.transition_model import TransitionModel, load_transitions
from nsm_core.model.networks.deferred import collect
from nsm_core.model.networks.delta import DeltaNetwork
from nsm_core.model.networks.delta_config import DeltaConfig
from nsm_core.model.networks.gap_config import GapConfig
from nsm_core.model.networks.gap_torch import GapNetwork, filled, gap_network
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.rtn_config import ErdConfig, ResLstmConfig, TransitionConfig
from nsm_core.model.networks.rtn_rows import TransitionSettings
from nsm_core.model.transitions.layout import PAST
from nsm_core.training.transitions import TransitionTrainer

KINDS = {
    "whole": TransitionConfig(**SMALL),
    "paper": TransitionConfig(**SMALL, arrival=False, homing=False, faced=False),
    "blind": TransitionConfig(**SMALL, terrain=False, initial="common"),
    "no future": TransitionConfig(**SMALL | {"future": 0}, arrival=False, homing=False),
    "f_reslstm": ResLstmConfig(**SMALL | {"encoder": 0, "decoder": 0}),
    "f_erd": ErdConfig(**SMALL),
    "delta": DeltaConfig(**SMALL_DELTA),
    "blind delta": DeltaConfig(**SMALL_DELTA, terrain=False, faced=False),
}


def network(config: GapConfig, seed: int = 0) -> GapNetwork:
    torch.manual_seed(seed)
    net = gap_network(config)
    if isinstance(net, DeltaNetwork):
        torch.nn.init.normal_(net.tell.weight, std=0.1)  # what is untrained interpolates
    source = GapSource(windows(), False, config.faced)
    for name, values in statistics_of(source, [10], np.random.default_rng(0)).items():
        getattr(net, name).copy_(torch.from_numpy(values))
    return net.eval()


@pytest.mark.parametrize("kind", KINDS)
def test_numpy_fills_a_gap_as_torch_does(kind):
    """The same features, read from a batch of windows and from a gap, through both forms of the network."""
    config = KINDS[kind]
    net = network(config)
    assert {n: tuple(p.shape) for n, p in net.named_parameters()} == config.parameter_shapes()
    frames = 7
    source = GapSource(windows(), True, config.faced)
    gaps = source.fixed(frames, 2)
    if not config.faced:
        gaps = source.gaps(frames, np.array([0]), *[np.zeros(1, int)] * 2, np.zeros(1), np.zeros(1, bool))
    with torch.no_grad():
        told = filled(net, gaps).joints.numpy()[0].reshape(frames + 1, 23, 3)
    arrays = {n: v.detach().numpy() for n, v in net.state_dict().items()}
    shapes = config.parameter_shapes()
    parts = {n: arrays[n] for n in shapes}, {n: v for n, v in arrays.items() if n not in shapes}
    model = TransitionModel(config, Weights(*parts))
    joints = gaps.joints[0]
    found = model.predict(
        joints[:PAST],
        joints[-2:],
        frames,
        lambda places: gaps.sampled(np.repeat(places[None], len(gaps.first), 0))[0],
    )
    assert np.abs(found - told).max() < 2e-4


def test_a_delta_network_interpolates_before_it_has_learnt_and_ends_at_its_target():
    gaps = GapSource(windows(), True, True).fixed(9, 2)
    ends = gaps.joints[:, [PAST - 1, -2]].reshape(2, 2, 1, 69)
    net = gap_network(KINDS["delta"])
    with torch.no_grad():
        told, learnt = (filled(n, gaps).joints.numpy() for n in (net, network(KINDS["delta"])))
    way = ends[:, 0] + np.arange(1, 11)[:, None] / 10 * (ends[:, 1] - ends[:, 0])
    assert np.abs(told - way).max() < 1e-5
    assert np.abs(learnt[:, :-1] - way[:, :-1]).max() > 0.01
    assert np.abs(learnt[:, -1] - ends[:, 1, 0]).max() < 1e-5


def test_weights_gradients_come_together_at_the_end():
    net, gaps = network(KINDS["whole"]), GapSource(windows(), False, True).fixed(5, 4)
    filled(net, gaps).error().backward()
    plain = {n: p.grad.clone() for n, p in net.named_parameters()}
    net.zero_grad()
    net.train()
    filled(net, gaps).error().backward()
    collect(net)
    for name, p in net.named_parameters():
        assert torch.allclose(p.grad, plain[name], rtol=1e-3, atol=1e-6), name


def test_gaps_are_seen_the_same_way_round_and_in_mirrors():
    source = GapSource(windows(), False, True)
    args = 8, np.array([0, 0]), *[np.zeros(2, int)] * 2, np.zeros(2), np.array([False, True])
    plain, mirrored = source.gaps(*args).joints
    assert np.allclose(plain[:, 0] * (-1, 1, 1), mirrored[:, 0], atol=1e-5)
    gaps = source.gaps(*args)
    roots = gaps.joints[:, :1, 0]
    places = roots[..., :2] + np.random.default_rng(0).uniform(-0.8, 0.8, (2, 50, 2)).astype(np.float32)
    assert np.abs(gaps.sampled(places) - gaps.heights(places)).mean() < 0.02
    patches = gaps.patches(roots).reshape(2, 13, 13)
    assert np.allclose(patches[0], patches[1, ::-1], atol=1e-4)


@pytest.mark.parametrize("kind", ("whole", "delta"))
def test_a_run_goes_on_where_it_was_and_its_weights_fill(kind, tmp_path):
    settings = TransitionSettings(minutes=1.0, shortest=3, longest=12, batch=8, world=1.0)
    trainer = TransitionTrainer(windows(), KINDS[kind], settings)
    first = [trainer.learn() for _ in range(3)]
    trainer.judge()
    trainer.save(tmp_path / "checkpoint.pt")
    again = TransitionTrainer(windows(), KINDS[kind], settings)
    again.load(tmp_path / "checkpoint.pt")
    assert again.step == 3 and np.isfinite(first).all()
    assert np.isclose(trainer.learn(), again.learn(), rtol=1e-4)
    other = TransitionTrainer(windows(), KINDS["blind"], settings)
    with pytest.raises(WeightsError, match="of another network"):
        other.load(tmp_path / "checkpoint.pt")
    model = load_transitions(trainer.export(tmp_path / "fill.npz"))
    assert model.metadata["held_out"] and model.metadata["credits"]
    clip = walk()
    asked = Gap(clip[30:40], clip[60:62], 20)
    one, same, varied = (fill(replace(asked, seed=s), model) for s in (0, 0, 5))
    assert len(one.clip) == 20 and one.gap_before_blend < 0.2
    assert np.array_equal(one.clip.hips_position, same.clip.hips_position)
    assert not np.array_equal(one.clip.hips_position, varied.clip.hips_position)
    assert len(fill(Gap(clip[39:40], clip[45:46], 5), model).clip) == 5


@pytest.mark.parametrize("kind", ("whole", "delta"))
def test_it_learns_what_all_walks_have(kind):
    settings = TransitionSettings(minutes=60.0, shortest=20, longest=30, batch=8, learning_rate=3e-3)
    trainer = TransitionTrainer(windows(), KINDS[kind], settings)
    before = trainer.judge()[0]
    for _ in range(25):
        trainer.learn()
    assert trainer.judge()[0] < 0.9 * before


def test_weights_that_are_no_transitions_are_refused(tmp_path, full_weights):
    with pytest.raises(WeightsError, match="network called 'nsm', and transitions"):
        load_transitions(full_weights)
    with pytest.raises(WeightsError, match="no weights file"):
        load_transitions(tmp_path / "none.npz")
    path = TransitionTrainer(windows(), KINDS["whole"], TransitionSettings()).export(tmp_path / "cut.npz")
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(WeightsError, match="truncated or damaged"):
        load_transitions(path)
    for wrong in ({"hidden": -3}, {"initial": "else"}, {"residual": 1}):
        with pytest.raises(WeightsError, match="which no network has"):
            TransitionConfig.from_dict(TransitionConfig().to_dict() | wrong)
    for wrong in ({"heads": 0}, {"width": 100}, {"layers": True}):
        with pytest.raises(WeightsError, match="which no network has"):
            DeltaConfig.from_dict(DeltaConfig().to_dict() | wrong)


def test_the_command_trains_and_writes(tmp_path, capsys):
    windows().save(tmp_path / "windows.npz")
    asked = [
        str(tmp_path),
        "--run",
        str(tmp_path),
        "--minutes",
        "0.0001",
        "--frames",
        "3",
        "6",
        "--batch",
        "2",
    ]
    assert command.main([*asked, "--threads", "1", "--no-terrain"]) == 0
    assert (
        "Wrote" in capsys.readouterr().out and load_transitions(tmp_path / "fill.npz").config.terrain is False
    )
