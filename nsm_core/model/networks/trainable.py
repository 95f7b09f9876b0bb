"""What every network is as a torch module: the protocol's step on tensors, and normalisation that travels
with it.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from nsm_core.model.features.layout import Inputs

from .config import STATISTICS, NetworkConfig

Tensors = dict[str, Tensor]  # memory or info by name, (B, size) each


class Trainable(nn.Module):
    """Base of the networks: a subclass defines ``forward`` and ``renormalise`` and names its parameters as
    its config does.

    Normalisation statistics travel with the module as float32 buffers, so that a snapshot is complete.
    """

    config: NetworkConfig

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        for name, size in zip(
            ("input", "gating", "output"), (config.inputs, config.gating, config.outputs), strict=True
        ):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_std", torch.ones(size))

    def forward(self, inputs: Inputs[Tensor], memory: Tensors) -> tuple[Tensor, Tensors, Tensors]:
        """Predict as ``Model.step``, but normalised outputs (B, outputs) of normalised inputs."""
        raise NotImplementedError

    def renormalise(self, old: dict[str, Tensor]) -> None:
        """Change the parameters so that ``step`` gives what it gave under the statistics ``old``, by name;
        for warm starts.
        """
        raise NotImplementedError

    def blind(self, part: str) -> None:
        """Let the network never learn to read a part of what it is given, by its name."""
        raise NotImplementedError

    def start(self, batch: int) -> Tensors:
        """Memory of ``batch`` characters before their first frame, where the parameters are."""
        return {
            name: torch.from_numpy(values).to(self.input_mean.device)
            for name, values in self.config.start(batch).items()
        }

    def normalised(self, inputs: Inputs[Tensor]) -> Inputs[Tensor]:
        """Inputs in physical units as ``forward`` takes them."""
        x, gating = inputs
        return Inputs((x - self.input_mean) / self.input_std, (gating - self.gating_mean) / self.gating_std)

    def physical(self, inputs: Inputs[Tensor]) -> Inputs[Tensor]:
        """Normalised inputs in physical units again."""
        x, gating = inputs
        return Inputs(x * self.input_std + self.input_mean, gating * self.gating_std + self.gating_mean)

    def step(self, inputs: Inputs[Tensor], memory: Tensors) -> tuple[Tensor, Tensors, Tensors]:
        """Predict in physical units: as ``forward``, with normalisation before and after."""
        y, memory, info = self(self.normalised(inputs), memory)
        return y * self.output_std + self.output_mean, memory, info

    def set_statistics(self, floor: float = 0.01, **statistics: Any) -> None:
        """Set any of STATISTICS from arrays; deviations under ``floor`` are raised to it.

        A feature that hardly moves in training would otherwise be blown up when it moves later.
        """
        for name, values in statistics.items():
            if name not in STATISTICS:
                raise ValueError(f"unknown statistic {name}; known are {', '.join(STATISTICS)}")
            values = torch.as_tensor(values, dtype=torch.float32)
            getattr(self, name).copy_(values.clamp_min(floor) if name.endswith("_std") else values)

    @torch.no_grad()
    def refresh(self, source: Trainable) -> None:
        """Take over the parameters and statistics of ``source``, cast to this module's types."""
        for mine, other in zip(self.parameters(), source.parameters(), strict=True):
            mine.copy_(other)
        for mine, other in zip(self.buffers(), source.buffers(), strict=True):
            mine.copy_(other)
