"""The network that tells fields around a thing, in numpy: its values, and their slopes by place and by latent
code, which planning descends.
"""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array

from .field_config import BLOCK, BLOCKS, COARSE, CONDITION, FieldConfig
from .protocol import Weights


class NumpyFields:
    """A network of sizes and the weights that fit them; rows are places."""

    def __init__(self, config: FieldConfig, weights: Weights) -> None:
        self.config, self._p = config, weights.parameters
        self.scale, self._query_scale = weights.statistics["field_scale"], weights.statistics["query_scale"]

    def values(self, query: Array, code: Array) -> Array:
        """Fields (P, 3), shares of ``scale``, of queries (P, 7) in physical units and a code (128,)."""
        return self._forward(query, code)[0]

    def by_place(self, query: Array, code: Array) -> tuple[Array, Array]:
        """Fields (P, 3) and the slope of the last of them, arrival, by place (P, 3), shares a metre."""
        out, passed = self._forward(query, code)
        ahead = np.zeros_like(out)
        ahead[:, 2] = 1.0
        slope = np.zeros_like(query)
        for n, back in self._backward(ahead, passed):
            if f"layer.{n}.query" in self._p:
                slope += back @ self._p[f"layer.{n}.query"]
        return out, (slope / self._query_scale)[:, CONDITION.size :]

    def by_code(self, query: Array, code: Array, ahead: Array, passed: list[Array]) -> Array:
        """Slope (128,) by the code of what has the slope ``ahead`` (P, 3) by the fields, after ``told``."""
        slope = np.zeros_like(code)
        for n, back in self._backward(ahead, passed):
            if f"layer.{n}.code" in self._p:
                slope += back.sum(0) @ self._p[f"layer.{n}.code"]
        return slope

    def guessed(self, seen: Array) -> Array:
        """A code (128,) of what is seen of a scene (8205,)."""
        p, cells = self._p, BLOCKS * 2 * BLOCK**3
        blocks = np.maximum(seen[:cells].reshape(BLOCKS, -1) @ p["block.weight"].T + p["block.bias"], 0)
        h = np.concatenate((blocks.ravel(), seen[cells:]))
        for n in range(3):
            h = p[f"encoder.{n}.weight"] @ h + p[f"encoder.{n}.bias"]
            h = np.maximum(h, 0) if n < 2 else h
        return np.asarray(h)

    def told(self, query: Array, code: Array) -> tuple[Array, list[Array]]:
        """Fields (P, 3) and what ``by_code`` needs of them."""
        return self._forward(query, code)

    def _forward(self, query: Array, code: Array) -> tuple[Array, list[Array]]:
        x = (query / self._query_scale).astype(np.float32)
        passed: list[Array] = []
        h = x
        for n in range(self.config.layers):
            y = h @ self._p[f"layer.{n}.weight"].T if n else np.float32(0)
            own = self._p[f"layer.{n}.bias"]
            if f"layer.{n}.code" in self._p:
                own = own + self._p[f"layer.{n}.code"] @ code
                y = y + x @ self._p[f"layer.{n}.query"].T
            h = np.maximum(y + own, 0)
            passed.append(h)
        return h @ self._p["out.weight"].T + self._p["out.bias"], passed

    def _backward(self, ahead: Array, passed: list[Array]) -> list[tuple[int, Array]]:
        """Slopes (P, width) before every layer's rectifier, the last layer first."""
        found = []
        back = ahead @ self._p["out.weight"]
        for n in reversed(range(self.config.layers)):
            back = back * (passed[n] > 0)
            found.append((n, back))
            if n:
                back = back @ self._p[f"layer.{n}.weight"]
        return found


def cells_of(target: Array, obstacles: Array, scale: Array) -> Array:
    """What the encoder sees of both known fields (..., N, N, N), float32 (..., 8192): means over COARSE cells
    along each side, block by block.
    """
    parts = []
    for values, most in zip((target, obstacles), scale, strict=False):
        lead, n, k = values.shape[:-3], values.shape[-1] // COARSE, COARSE // BLOCK
        cells = values.reshape(*lead, COARSE, n, COARSE, n, COARSE, n).mean((-5, -3, -1)) / most
        cells = cells.reshape(*lead, k, BLOCK, k, BLOCK, k, BLOCK)
        d = len(lead)
        order = (*range(d), *(d + axis for axis in (0, 2, 4, 1, 3, 5)))
        parts.append(cells.transpose(order).reshape(*lead, BLOCKS, -1))
    both = np.concatenate(parts, axis=-1)
    return both.reshape(*both.shape[:-2], -1).astype(np.float32)


def seen_of(cells: Array, condition: Array, task: Array, query_scale: Array) -> Array:
    """What the encoder is given (..., 8205), float32: ``cells_of`` the fields, the condition (..., 4) and the
    task (..., 9).
    """
    given = condition / query_scale[: CONDITION.size]
    return np.concatenate((cells, given, task), axis=-1).astype(np.float32)


__all__ = ["NumpyFields", "cells_of", "seen_of"]
