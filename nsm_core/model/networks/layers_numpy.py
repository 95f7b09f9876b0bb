"""Layers of the networks in numpy; rows are characters."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array


def dense(weight: Array, bias: Array, h: Array) -> Array:
    """Map (B, in) by weights (out, in) and bias (out,) to (B, out)."""
    return h @ weight.T + bias


def elu(x: Array) -> Array:
    """``x`` where it is positive, exp(x) - 1 elsewhere (papers/000 equation 4)."""
    return np.where(x > 0, x, np.expm1(np.minimum(x, 0)))


def softmax(x: Array) -> Array:
    """Positive shares (B, N) that add up to one."""
    e = np.exp(x - x.max(axis=1, keepdims=True))
    return e / e.sum(axis=1, keepdims=True)


def sigmoid(x: Array) -> Array:
    """1 / (1 + exp(-x)), by a function that does not overflow."""
    return 0.5 + 0.5 * np.tanh(0.5 * x)
