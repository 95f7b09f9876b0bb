"""Start a training from a network that was trained on other data: same function, new normalisation."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor

from nsm_core.errors import WeightsError
from nsm_core.model.inference.weights_file import load_weights
from nsm_core.model.networks.nsm import NSM

from .trainer import read_checkpoint

# A feature whose deviation grows by more than this was not alive in the old data; its weights mean nothing and are kept as drawn.
_UNKNOWN = 4.0


@torch.no_grad()
def start_from(net: NSM, source: str | Path) -> None:
    """Give ``net`` the parameters of a checkpoint (.pt) or a weights file (.npz), adapted to its own statistics.

    First and last layers take up the change of means and deviations, so that the network computes what it did before, but
    for features that the old data did not have.  Call it after ``set_statistics``.  Raises WeightsError on a file that is
    damaged or of another network.
    """
    path = Path(source)
    if path.suffix == ".npz":
        weights = load_weights(path)
        state = {k: torch.from_numpy(v) for k, v in {**weights.parameters, **weights.statistics}.items()}
    else:
        state = read_checkpoint(path).get("average", {})
    new = {k: v.clone() for k, v in net.state_dict().items() if k.endswith(("_mean", "_std"))}
    try:
        net.load_state_dict(state)
    except (RuntimeError, AttributeError, TypeError) as error:
        raise WeightsError(f"{path} is of another network than the one to train; choose one of the same sizes.") from error
    old = {k: getattr(net, k).clone() for k in new}
    for name, values in new.items():
        getattr(net, name).copy_(values)
    ratio, shift = _change(old, new, "input")
    at = 0
    for encoder, width in zip(net.encoders, net.config.parts, strict=True):
        _into(encoder.layers[0].weight, encoder.layers[0].bias, ratio[at : at + width], shift[at : at + width])
        at += width
    _into(net.gating[0].weight, net.gating[0].bias, *_change(old, new, "gating"))
    last = net.experts[-1]
    scale = old["output_std"] / new["output_std"]
    last.weight.mul_(scale[None, :, None])
    last.bias.mul_(scale).add_((old["output_mean"] - new["output_mean"]) / new["output_std"])


def _change(old: dict[str, Tensor], new: dict[str, Tensor], name: str) -> tuple[Tensor, Tensor]:
    """Old normalised value = new one times ratio plus shift, (size,) each."""
    ratio = new[f"{name}_std"] / old[f"{name}_std"]
    shift = (new[f"{name}_mean"] - old[f"{name}_mean"]) / old[f"{name}_std"]
    unknown = ratio > _UNKNOWN
    return torch.where(unknown, 1.0, ratio), torch.where(unknown, 0.0, shift)


def _into(weight: Tensor, bias: Tensor, ratio: Tensor, shift: Tensor) -> None:
    bias.add_(weight @ shift)
    weight.mul_(ratio)
