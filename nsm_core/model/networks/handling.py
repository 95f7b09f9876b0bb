"""The controller's network as a torch module: a mixture of experts gated by key joints and phases."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from nsm_core.model.handling.layout import GATE, INPUT, OUTPUT, UNSEEN

from .encoded import dense
from .handling_config import FAR, HandlingConfig
from .nsm import ExpertLinear


class HandlingNet(nn.Module):
    """Parameters as ``HandlingConfig.parameter_shapes`` has them; ``forward`` takes inputs (B, INPUT.size) in
    physical units to normalised outputs (B, OUTPUT.size).
    """

    def __init__(self, config: HandlingConfig, dropout: float = 0.1) -> None:
        super().__init__()
        self.config, self.dropout = config, dropout
        wide = (len(GATE), config.gate, config.gate, config.experts)
        self.gating = nn.ModuleList(dense(i, o) for i, o in zip(wide[:-1], wide[1:], strict=True))
        # A small last layer lets all experts learn from the first step.
        self.gating[-1].weight.data.mul_(0.1)
        wide = (INPUT.size, config.hidden, config.hidden, OUTPUT.size)
        self.layers = nn.ModuleList(
            ExpertLinear(config.experts, i, o) for i, o in zip(wide[:-1], wide[1:], strict=True)
        )
        # Outputs are changes: one begins with none.
        self.layers[-1].weight.data.mul_(0.1)
        self.register_buffer("gate_columns", torch.from_numpy(GATE))
        self.register_buffer("unseen", torch.from_numpy(UNSEEN))
        for name, size in (("input", INPUT.size), ("output", OUTPUT.size)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_std", torch.ones(size))

    def forward(self, inputs: Tensor) -> Tensor:
        """As the class says."""
        x = ((inputs - self.input_mean) / self.input_std).clamp(-FAR, FAR)
        if not self.config.goal_phase:
            x = x.index_fill(1, self.unseen, 0.0)
        h = x[:, self.gate_columns]
        for layer in self.gating[:-1]:
            h = F.elu(layer(h))
        coefficients = torch.softmax(self.gating[-1](h), dim=-1)
        h = F.dropout(x, self.dropout, self.training)
        for n, layer in enumerate(self.layers):
            h = layer(h, coefficients)
            h = F.dropout(F.elu(h), self.dropout, self.training) if n < len(self.layers) - 1 else h
        return h.float()

    def named(self) -> dict[str, Any]:
        """Parameters by the names of ``HandlingConfig.parameter_shapes``, as arrays."""
        names = self.config.parameter_shapes()
        return {n: v.detach().numpy() for n, v in self.named_parameters() if n in names}


__all__ = ["HandlingNet"]
