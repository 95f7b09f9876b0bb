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
from nsm_core.rotations import Array

from .encoded import Encoded, dense, fold_in
from .gate_features import GATE_PARTS, modulated_columns
from .nsm_config import NsmConfig
from .trainable import Tensors


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


class Blended(Encoded):
    """Encoders and a prediction network whose weights are blended; a subclass says by which coefficients."""

    config: NsmConfig

    def __init__(self, config: NsmConfig) -> None:
        super().__init__(config)
        self.build_gate()
        c = config
        widths = (sum(c.encoded), c.hidden, c.hidden, c.outputs)
        self.experts = nn.ModuleList(
            ExpertLinear(c.experts, i, o) for i, o in zip(widths[:-1], widths[1:], strict=True)
        )

    def build_gate(self) -> None:
        """Make what the coefficients are computed with, if that has parameters."""

    def coefficients(self, inputs: Inputs[Tensor]) -> Tensor:
        """Blending coefficients (B, K), float32, of normalised inputs."""
        raise NotImplementedError

    def forward(self, inputs: Inputs[Tensor], memory: Tensors) -> tuple[Tensor, Tensors, Tensors]:
        """As ``Trainable.forward``; there is no memory, and the info "experts" are the coefficients
        (B, K).
        """
        coefficients = self.coefficients(inputs)
        h = self.encode(inputs)
        for i, layer in enumerate(self.experts):
            h = layer(F.dropout(h, self.config.dropout, self.training), coefficients)
            h = F.elu(h) if i < len(self.experts) - 1 else h
        return h.float(), {}, {"experts": coefficients}

    @property
    def last(self) -> Any:
        """The layer that gives the outputs."""
        return self.experts[-1]


class NSM(Blended):
    """Neural State Machine: encoders, gating network and blended prediction network."""

    def __init__(self, config: NsmConfig | None = None) -> None:
        super().__init__(config or NsmConfig())

    def build_gate(self) -> None:
        """Three dense layers."""
        c = self.config
        widths = (c.gates, c.gating_hidden, c.gating_hidden, c.experts)
        self.gating = nn.ModuleList(dense(i, o) for i, o in zip(widths[:-1], widths[1:], strict=True))
        # A small last layer lets all experts learn from the first step, instead of those that the draw
        # favours.
        self.gating[-1].weight.data.mul_(0.1)

    def gate_features(self, inputs: Inputs[Tensor]) -> Tensor:
        """What the gating network is fed (B, gates), of normalised inputs."""
        return inputs.gating

    def coefficients(self, inputs: Inputs[Tensor]) -> Tensor:
        """As ``Blended.coefficients``, by the gating network."""
        h = F.dropout(self.gate_features(inputs), self.config.dropout, self.training)
        for layer in self.gating[:-1]:
            h = F.dropout(F.elu(layer(h)), self.config.dropout, self.training)
        return torch.softmax(self.gating[-1](h).float(), dim=-1)

    def reader(self, part: str) -> tuple[Tensor, Any]:
        """As ``Encoded.reader``, and of what gates, parts of ``GATE_PARTS``."""
        if part not in GATE_PARTS:
            return super().reader(part)
        return self.gating[0].weight, self.gate_columns(part)

    def gate_columns(self, part: str) -> Array:
        """Columns of what the gating network is fed that a part of ``GATE_PARTS`` fills."""
        return modulated_columns(part)

    def refit_gate(self, old: dict[str, Tensor]) -> None:
        """As ``Encoded.refit_gate``."""
        fold_in(self.gating[0].weight, self.gating[0].bias, *self.change(old, "gating"))
