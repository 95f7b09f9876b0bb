"""Dense layers of recurrent networks whose weights' gradients are worked out once a sequence.

A step of a recurrent layer has few rows, and adding the gradient of its weights frame by frame costs more
memory traffic than arithmetic; over all frames it is one product.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F


class DeferredLinear(nn.Linear):
    """As ``nn.Linear``; in training ``collect`` must be called after ``backward``."""

    def __init__(self, inputs: int, outputs: int, bias: bool = True) -> None:
        super().__init__(inputs, outputs, bias)
        self.seen: list[tuple[Tensor, Tensor]] = []

    def forward(self, x: Tensor) -> Tensor:
        if not (self.training and torch.is_grad_enabled()):
            return F.linear(x, self.weight, self.bias)
        out: Tensor = _Later.apply(x, self.weight, self.bias, self)
        return out

    def collect(self) -> None:
        """Put the gradient of all uses since the last time where the optimiser looks for it."""
        if not self.seen:
            return
        x = torch.cat([x.flatten(0, -2) for x, _ in self.seen])
        g = torch.cat([g.flatten(0, -2) for _, g in self.seen])
        self.seen.clear()
        self.weight.grad = g.t() @ x
        if self.bias is not None:
            self.bias.grad = g.sum(0)


class _Later(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor | None, layer: DeferredLinear) -> Tensor:
        ctx.layer = layer
        ctx.save_for_backward(x, weight)
        return F.linear(x, weight, bias)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, None, None, None]:
        x, weight = ctx.saved_tensors
        ctx.layer.seen.append((x.detach(), grads[0]))
        return (grads[0] @ weight if ctx.needs_input_grad[0] else None), None, None, None


def collect(module: nn.Module) -> None:
    """``DeferredLinear.collect`` of all layers of a module."""
    for layer in module.modules():
        if isinstance(layer, DeferredLinear):
            layer.collect()


__all__ = ["DeferredLinear", "collect"]
