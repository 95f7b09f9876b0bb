"""A training that starts from another network keeps its function, whatever the new data's means and
deviations.
"""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from nsm_core.model.features.layout import Inputs, layout_description
from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.config import STATISTICS
from nsm_core.model.networks.nsm import NSM
from nsm_core.model.networks.nsm_config import NsmConfig
from nsm_core.training.warm_start import start_from

SMALL = NsmConfig(
    encoder_frame=16,
    encoder_goal=8,
    encoder_environment=16,
    encoder_interaction=8,
    gating_hidden=8,
    hidden=16,
    experts=3,
)


def drawn(seed: int, like: NSM | None = None) -> NSM:
    """A small network with random weights and statistics, those up to threefold of another's."""
    torch.manual_seed(seed)
    rng, net = np.random.default_rng(seed), NSM(SMALL)
    statistics = {}
    for name in STATISTICS:
        size = len(getattr(net, name))
        values = np.exp(rng.normal(0, 0.3, size)) if name.endswith("_std") else rng.normal(0, 1, size)
        if like is not None and name.endswith("_std"):
            values = values.clip(0.5, 3) * getattr(like, name).numpy()
        statistics[name] = values
    net.set_statistics(floor=1e-6, **statistics)
    return net


def outputs(net: NSM, seed: int = 5) -> np.ndarray:
    generator = torch.Generator().manual_seed(seed)
    x, g = (
        torch.randn(4, SMALL.inputs, generator=generator),
        torch.randn(4, SMALL.gating, generator=generator),
    )
    with torch.no_grad():
        return net.step(Inputs(x, g), {})[0].numpy()


@pytest.mark.parametrize("kind", ["pt", "npz"])
def test_function_is_kept(tmp_path, kind):
    old = drawn(1)
    new = drawn(2, old)
    before = {name: getattr(new, name).clone() for name in STATISTICS}
    path = tmp_path / f"old.{kind}"
    if kind == "pt":
        torch.save({"average": old.state_dict()}, path)
        share = 1e-5  # new means and deviations are multiplied into single precision, 1e-7 each
    else:
        statistics = {name: getattr(old, name).numpy() for name in STATISTICS}
        parameters = {k: v.detach().numpy() for k, v in old.named_parameters()}
        save_weights(path, parameters, statistics, config=SMALL, layout=layout_description())
        share = 5e-3  # parameters are stored in half precision, 0.05 % each
    assert np.abs(outputs(new) - outputs(old)).max() > 0.3
    start_from(new, path)
    kept = outputs(old)
    assert np.abs(outputs(new) - kept).max() < share * np.abs(kept).max()
    for name, values in before.items():
        torch.testing.assert_close(getattr(new, name), values)


def test_a_feature_that_was_dead_in_the_old_data_is_not_blown_up(tmp_path):
    old = drawn(1)
    new = drawn(2, old)
    with torch.no_grad():
        old.input_std[3], new.input_std[3] = 0.01, 0.5
    torch.save({"average": old.state_dict()}, tmp_path / "old.pt")
    start_from(new, tmp_path / "old.pt")
    torch.testing.assert_close(new.encoders[0].layers[0].weight[:, 3], old.encoders[0].layers[0].weight[:, 3])
