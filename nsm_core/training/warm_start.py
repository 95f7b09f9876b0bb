"""Start a training from a network that was trained on other data: same function, new normalisation."""

from __future__ import annotations

from pathlib import Path

import torch

from nsm_core.errors import WeightsError
from nsm_core.model.inference.weights_file import load_weights
from nsm_core.model.networks.trainable import Trainable

from .checkpoint import read_checkpoint


@torch.no_grad()
def start_from(net: Trainable, source: str | Path) -> None:
    """Give ``net`` the parameters of a checkpoint (.pt) or a weights file (.npz), adapted to its own
    statistics.

    The network computes what it did before (``Trainable.renormalise``), but for features that the old data
    did not have.
    Call it after ``set_statistics``.  Raises WeightsError on a file that is damaged or of another network.
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
        raise WeightsError(
            f"{path} is of another network than the one to train; choose one of the same sizes."
        ) from error
    old = {k: getattr(net, k).clone() for k in new}
    for name, values in new.items():
        getattr(net, name).copy_(values)
    net.renormalise(old)
