"""A recurrent network: encoder, four LSTM layers and decoder (papers/000 section 7.1)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from nsm_core.model.features.layout import Inputs

from .encoded import Encoded, dense
from .lstm_config import LAYERS, LstmConfig
from .trainable import Tensors


class LSTM(Encoded):
    """Encoders, the gating features among what they read, four recurrent layers and two dense ones."""

    config: LstmConfig

    def __init__(self, config: LstmConfig) -> None:
        super().__init__(config)
        h = config.hidden
        self.read = nn.ModuleList((dense(sum(config.encoded), h),))
        self.cells = nn.ModuleList(dense(2 * h, 4 * h) for _ in range(LAYERS))
        for cell in self.cells:  # remembering is what is learnt first
            cell.bias.data[h : 2 * h] = 1.0
        self.tell = nn.ModuleList((dense(h, h), dense(h, config.outputs)))

    def forward(self, inputs: Inputs[Tensor], memory: Tensors) -> tuple[Tensor, Tensors, Tensors]:
        """As ``Trainable.forward``; remembers the state of every recurrent layer."""
        x, after = F.elu(self.read[0](self.encode(inputs))).float(), Tensors()
        for n, layer in enumerate(self.cells):
            hidden, cell = memory[f"hidden{n}"], memory[f"cell{n}"]
            gates = layer(torch.cat((F.dropout(x, self.config.dropout, self.training), hidden), dim=1))
            come, stay, new, tell = gates.float().chunk(4, dim=1)
            cell = torch.sigmoid(stay) * cell + torch.sigmoid(come) * torch.tanh(new)
            x = torch.sigmoid(tell) * torch.tanh(cell)
            after |= {f"hidden{n}": x, f"cell{n}": cell}
        return self.tell[1](F.elu(self.tell[0](x))).float(), after, {}

    @property
    def last(self) -> nn.Linear:
        """The layer that gives the outputs."""
        return self.tell[-1]
