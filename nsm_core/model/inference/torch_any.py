"""The training module itself, stepped in torch."""

from __future__ import annotations

from nsm_core.rotations import Array

from .sizes import checked_inputs, config_of
from .weights_file import Weights


class TorchModel:
    """The training module itself, single precision; raises ImportError where torch is missing."""

    backend = "torch"

    def __init__(self, weights: Weights) -> None:
        import torch

        from nsm_core.model.networks.nsm import NSM

        self.config, self.metadata = config_of(weights), weights.metadata
        self._torch = torch
        self._net = NSM(self.config).eval()
        state = {name: torch.from_numpy(values) for name, values in {**weights.parameters, **weights.statistics}.items()}
        self._net.load_state_dict(state)

    def predict(self, x: Array, gating: Array) -> tuple[Array, Array]:
        """Predict as ``Model.predict`` says."""
        x, gating = checked_inputs(x, gating, self.config)
        with self._torch.inference_mode():
            y, coefficients = self._net.predict(self._torch.from_numpy(x), self._torch.from_numpy(gating))
        return y.numpy(), coefficients.numpy()
