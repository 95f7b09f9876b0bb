"""The Neural State Machine as a torch module (papers/000 sections 3.1 and 3.2); training and reference.

Four encoders feed a prediction network whose weights and biases are blended, per sample, from K experts
by the coefficients of a gating network.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from nsm_core.model.features.layout import Inputs

from .nsm_config import NsmConfig
from .trainable import Tensors, Trainable

# A feature whose deviation grows by more than this was not alive in the old data; its weights mean nothing
# and are kept as drawn.
_UNKNOWN = 4.0


class _MixExperts(torch.autograd.Function):
    """``y[b] = sum_k c[b, k] W_k x[b]`` as one matrix product over all experts.

    Blending the experts' outputs equals blending their weights, since the layer is linear.  The hand-written
    backward pass keeps every large tensor in the autocast type: at batch 512 on two cores it is a third
    faster than leaving the same formula to autograd, and faster than scaling the inputs by the coefficients.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, coefficients: Tensor, weights: Tensor) -> Tensor:
        device = x.device.type
        dtype = torch.get_autocast_dtype(device) if torch.is_autocast_enabled(device) else weights.dtype
        x_, w_ = x.to(dtype), weights.to(dtype)
        c_ = coefficients.to(dtype)
        experts, out, _ = weights.shape
        y = F.linear(x_, w_.view(experts * out, -1)).view(-1, experts, out)
        ctx.save_for_backward(x_, c_, w_, y)
        ctx.types = x.dtype, coefficients.dtype, weights.dtype
        return torch.bmm(c_.unsqueeze(1), y).squeeze(1)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        x, c, w, y = ctx.saved_tensors
        experts, out, _ = w.shape
        x_type, c_type, w_type = ctx.types
        grad = grad.to(w.dtype)
        grad_c = torch.bmm(y, grad.unsqueeze(2)).squeeze(2)
        grad_y = (c.unsqueeze(2) * grad.unsqueeze(1)).view(len(x), experts * out)
        grad_x = grad_y @ w.view(experts * out, -1)
        grad_w = (grad_y.t() @ x).view_as(w)
        return grad_x.to(x_type), grad_c.to(c_type), grad_w.to(w_type)


class ExpertLinear(nn.Module):
    """Dense layer whose weights (K, out, in) and biases (K, out) are blended per sample."""

    def __init__(self, experts: int, inputs: int, outputs: int) -> None:
        """Start every expert half from one shared draw and half from its own.

        The release draws from +-sqrt(6 / (in * out)), some 16 times smaller than Glorot at this size, which
        all but silences the signal at first; independent Glorot draws shrink by sqrt(K) when mixed evenly.
        With the shared half the variance stays between 0.56 and 1 for every mixture.
        """
        super().__init__()
        bound = math.sqrt(3 / inputs)
        shared = torch.empty(1, outputs, inputs).uniform_(-bound, bound)
        own = torch.empty(experts, outputs, inputs).uniform_(-bound, bound)
        self.weight = nn.Parameter((shared + own) * math.sqrt(0.5))
        self.bias = nn.Parameter(torch.zeros(experts, outputs))

    def forward(self, x: Tensor, coefficients: Tensor) -> Tensor:
        """Map (B, in) by the mixture (B, K) of experts to (B, out)."""
        return _MixExperts.apply(x, coefficients, self.weight) + coefficients.to(self.bias.dtype) @ self.bias


class Encoder(nn.Module):
    """Two dense layers, ELU after both."""

    def __init__(self, inputs: int, outputs: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.ModuleList((_dense(inputs, outputs), _dense(outputs, outputs)))
        self.dropout = dropout

    def forward(self, x: Tensor) -> Tensor:
        """Encode (B, in) into (B, out)."""
        for layer in self.layers:
            x = F.elu(layer(F.dropout(x, self.dropout, self.training)))
        return x


class NSM(Trainable):
    """Neural State Machine: encoders, gating network and blended prediction network."""

    config: NsmConfig

    def __init__(self, config: NsmConfig | None = None) -> None:
        c = config or NsmConfig()
        super().__init__(c)
        self.encoders = nn.ModuleList(
            Encoder(i, o, c.dropout) for i, o in zip(c.parts, c.encoded, strict=True)
        )
        widths = (c.gating, c.gating_hidden, c.gating_hidden, c.experts)
        self.gating = nn.ModuleList(_dense(i, o) for i, o in zip(widths[:-1], widths[1:], strict=True))
        # A small last layer lets all experts learn from the first step, instead of those that the draw
        # favours.
        self.gating[-1].weight.data.mul_(0.1)
        widths = (sum(c.encoded), c.hidden, c.hidden, c.outputs)
        self.experts = nn.ModuleList(
            ExpertLinear(c.experts, i, o) for i, o in zip(widths[:-1], widths[1:], strict=True)
        )

    def coefficients(self, gating: Tensor) -> Tensor:
        """Blending coefficients (B, K), float32, of normalised gating features (B, gating)."""
        h = F.dropout(gating, self.config.dropout, self.training)
        for layer in self.gating[:-1]:
            h = F.dropout(F.elu(layer(h)), self.config.dropout, self.training)
        return torch.softmax(self.gating[-1](h).float(), dim=-1)

    def forward(self, inputs: Inputs[Tensor], memory: Tensors) -> tuple[Tensor, Tensors, Tensors]:
        """As ``Trainable.forward``; there is no memory, and the info "experts" are the coefficients
        (B, K).
        """
        coefficients = self.coefficients(inputs.gating)
        parts = inputs.features.split(self.config.parts, dim=-1)
        h = torch.cat([encoder(part) for encoder, part in zip(self.encoders, parts, strict=True)], dim=-1)
        for i, layer in enumerate(self.experts):
            h = layer(F.dropout(h, self.config.dropout, self.training), coefficients)
            h = F.elu(h) if i < len(self.experts) - 1 else h
        return h.float(), {}, {"experts": coefficients}

    @torch.no_grad()
    def renormalise(self, old: dict[str, Tensor]) -> None:
        """First and last layers take up the change of means and deviations; features that the old data did
        not have start as drawn.
        """
        ratio, shift = self._change(old, "input")
        at = 0
        for encoder, width in zip(self.encoders, self.config.parts, strict=True):
            _into(
                encoder.layers[0].weight,
                encoder.layers[0].bias,
                ratio[at : at + width],
                shift[at : at + width],
            )
            at += width
        _into(self.gating[0].weight, self.gating[0].bias, *self._change(old, "gating"))
        last, scale = self.experts[-1], old["output_std"] / self.output_std
        last.weight.mul_(scale[None, :, None])
        last.bias.mul_(scale).add_((old["output_mean"] - self.output_mean) / self.output_std)

    def _change(self, old: dict[str, Tensor], name: str) -> tuple[Tensor, Tensor]:
        """Old normalised value = new one times ratio plus shift, (size,) each."""
        ratio = getattr(self, f"{name}_std") / old[f"{name}_std"]
        shift = (getattr(self, f"{name}_mean") - old[f"{name}_mean"]) / old[f"{name}_std"]
        unknown = ratio > _UNKNOWN
        return torch.where(unknown, 1.0, ratio), torch.where(unknown, 0.0, shift)


def _into(weight: Tensor, bias: Tensor, ratio: Tensor, shift: Tensor) -> None:
    bias.add_(weight @ shift)
    weight.mul_(ratio)


def _dense(inputs: int, outputs: int) -> nn.Linear:
    """Dense layer with Glorot-normal weights and zero bias, as the release's encoders."""
    layer = nn.Linear(inputs, outputs)
    nn.init.xavier_normal_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer
