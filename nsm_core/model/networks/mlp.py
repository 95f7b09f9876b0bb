"""A multi-layer perceptron of the Neural State Machine's size: encoders and one set of weights for all
motions.
"""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional as F

from nsm_core.model.features.layout import Inputs

from .encoded import Encoded, dense
from .mlp_config import MlpConfig
from .trainable import Tensors


class MLP(Encoded):
    """Encoders, the gating features among what they read, and three dense layers."""

    config: MlpConfig

    def __init__(self, config: MlpConfig) -> None:
        super().__init__(config)
        widths = (sum(config.encoded), config.hidden, config.hidden, config.outputs)
        self.layers = nn.ModuleList(dense(i, o) for i, o in zip(widths[:-1], widths[1:], strict=True))

    def forward(self, inputs: Inputs[Tensor], memory: Tensors) -> tuple[Tensor, Tensors, Tensors]:
        """As ``Trainable.forward``; there is no memory and nothing to tell."""
        h = self.encode(inputs)
        for i, layer in enumerate(self.layers):
            h = layer(F.dropout(h, self.config.dropout, self.training))
            h = F.elu(h) if i < len(self.layers) - 1 else h
        return h.float(), {}, {}

    @property
    def last(self) -> nn.Linear:
        """The layer that gives the outputs."""
        return self.layers[-1]
