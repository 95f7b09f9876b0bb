"""Any network's training module, stepped in torch."""

from __future__ import annotations

from nsm_core.model.features.layout import Inputs
from nsm_core.model.networks.config import Memory, NetworkConfig
from nsm_core.model.networks.protocol import Info, Weights
from nsm_core.model.networks.registry import NetworkKind
from nsm_core.rotations import Array


class TorchModel:
    """The training module itself as a ``Model``, single precision; raises ImportError where torch is
    missing.
    """

    backend = "torch"

    def __init__(self, kind: NetworkKind, config: NetworkConfig, weights: Weights) -> None:
        """``weights`` hold every array of ``config.shapes()``."""
        import torch

        self.config, self.metadata = config, weights.metadata
        self._torch = torch
        self._net = kind.module(config).eval()
        state = {
            name: torch.from_numpy(values)
            for name, values in {**weights.parameters, **weights.statistics}.items()
        }
        self._net.load_state_dict(state)

    def start(self, batch: int = 1) -> Memory:
        """As ``Model.start`` says."""
        return self.config.start(batch)

    def step(self, inputs: Inputs[Array], memory: Memory) -> tuple[Array, Memory, Info]:
        """Predict as ``Model.step`` says."""
        x, gating = self.config.checked(inputs, memory)
        tensor = self._torch.from_numpy
        with self._torch.inference_mode():
            remembered = {name: tensor(values) for name, values in memory.items()}
            y, remembered, info = self._net.step(Inputs(tensor(x), tensor(gating)), remembered)
        return (
            y.numpy(),
            {k: v.numpy() for k, v in remembered.items()},
            {k: v.numpy() for k, v in info.items()},
        )
