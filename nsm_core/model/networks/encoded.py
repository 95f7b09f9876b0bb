"""What all networks of the comparison share as torch modules: encoders of the input's parts."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from nsm_core.model.features.layout import INPUT, Inputs

from .encoded_config import EncodedConfig
from .trainable import Trainable

# A feature whose deviation grows by more than this was not alive in the old data; its weights mean nothing
# and are kept as drawn.
_UNKNOWN = 4.0


class Encoder(nn.Module):
    """Two dense layers, ELU after both."""

    def __init__(self, inputs: int, outputs: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.ModuleList((dense(inputs, outputs), dense(outputs, outputs)))
        self.dropout = dropout

    def forward(self, x: Tensor) -> Tensor:
        """Encode (B, in) into (B, out)."""
        for layer in self.layers:
            x = F.elu(layer(F.dropout(x, self.dropout, self.training)))
        return x


class Encoded(Trainable):
    """Base of networks that encode their inputs; a subclass adds what predicts from the encodings and names
    its ``last`` layer.
    """

    config: EncodedConfig

    def __init__(self, config: EncodedConfig) -> None:
        super().__init__(config)
        self.encoders = nn.ModuleList(
            Encoder(i, o, config.dropout) for i, o in zip(config.read, config.encoded, strict=True)
        )

    @property
    def last(self) -> Any:
        """The layer that gives the outputs, with ``weight`` (..., out, in) and ``bias`` (..., out)."""
        raise NotImplementedError

    def encode(self, inputs: Inputs[Tensor]) -> Tensor:
        """Encodings side by side (B, sum of encoded) of normalised inputs."""
        parts = inputs.features.split(self.config.parts, dim=-1)
        parts = (*parts, inputs.gating)[: len(self.encoders)]
        return torch.cat([encoder(part) for encoder, part in zip(self.encoders, parts, strict=True)], dim=-1)

    @torch.no_grad()
    def blind(self, part: str) -> None:
        """As ``Trainable.blind``: the weights that read a part of the input (``INPUT``) stay zero, so that
        the weights file is blind by itself, whatever steps it.
        """
        weight, columns = self.reader(part)
        weight[:, columns] = 0

        def kept(gradient: Tensor) -> Tensor:
            gradient = gradient.clone()
            gradient[:, columns] = 0
            return gradient

        weight.register_hook(kept)

    def reader(self, part: str) -> tuple[Tensor, Any]:
        """Weights (out, in) that read a part of what the network is given, and which of their columns."""
        return self.encoders[list(INPUT.slices).index(part)].layers[0].weight, slice(None)

    @torch.no_grad()
    def renormalise(self, old: dict[str, Tensor]) -> None:
        """First and last layers take up the change of means and deviations; features that the old data did
        not have start as drawn.
        """
        changes = [
            torch.cat(both)
            for both in zip(self.change(old, "input"), self.change(old, "gating"), strict=True)
        ]
        for encoder, *change in zip(
            self.encoders, *(c.split((*self.config.parts, self.config.gating)) for c in changes), strict=False
        ):
            fold_in(encoder.layers[0].weight, encoder.layers[0].bias, *change)
        self.refit_gate(old)
        scale = old["output_std"] / self.output_std
        self.last.weight.mul_(scale[:, None])
        self.last.bias.mul_(scale).add_((old["output_mean"] - self.output_mean) / self.output_std)

    def refit_gate(self, old: dict[str, Tensor]) -> None:
        """As ``renormalise``, for what else reads normalised inputs."""

    def change(self, old: dict[str, Tensor], name: str) -> tuple[Tensor, Tensor]:
        """Old normalised value = new one times ratio plus shift, (size,) each."""
        ratio = getattr(self, f"{name}_std") / old[f"{name}_std"]
        shift = (getattr(self, f"{name}_mean") - old[f"{name}_mean"]) / old[f"{name}_std"]
        unknown = ratio > _UNKNOWN
        return torch.where(unknown, 1.0, ratio), torch.where(unknown, 0.0, shift)


def fold_in(weight: Tensor, bias: Tensor, ratio: Tensor, shift: Tensor) -> None:
    """Have a dense layer read its inputs times ``ratio`` plus ``shift``."""
    bias.add_(weight @ shift)
    weight.mul_(ratio)


def dense(inputs: int, outputs: int) -> nn.Linear:
    """Dense layer with Glorot-normal weights and zero bias, as the release's encoders."""
    layer = nn.Linear(inputs, outputs)
    nn.init.xavier_normal_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer
