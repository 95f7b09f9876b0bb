"""The delta transformer in numpy alone; as its torch module."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES
from nsm_core.rotations import Array

from .delta_config import DeltaConfig
from .delta_frames import placed, shown
from .gap_config import LONGEST, openness
from .protocol import Weights

_SMALL = 1e-5  # added to variances, as torch does


class NumpyDelta:
    """A network of sizes and the weights that fit them."""

    def __init__(self, config: DeltaConfig, weights: Weights) -> None:
        self.config, self._p = config, weights.parameters
        self.statistics = weights.statistics

    def fill(
        self, joints: Array, frames: int, patches: Callable[[Array], Array] | None, noise: Array | None
    ) -> Array:
        """World joints (frames + 1, 69), metres, of the missing frames and the target's, of past, target and
        the frame behind it (PAST + 2, 23, 3); ``patches`` gives those (T, 169),
        metres, around hips (T, 3), ``noise`` (width,) is a variation.
        """
        around = None if patches is None else lambda hips: patches(hips[0])[None]
        seen = shown(joints[None], frames, self.config.width, self.statistics, around)
        extra = seen.when if noise is None else seen.when + openness(seen.left)[:, None] * noise
        told = self.told(seen.tokens[0], extra)
        out: Array = placed(told[None], seen.base, seen.reach)[0]
        return out

    def told(self, tokens: Array, extra: Array) -> Array:
        """As ``DeltaNetwork.forward`` for one gap (T, seen)."""
        x = self._dense("read", tokens) + extra
        place = np.arange(len(x))
        apart = np.clip(place[None] - place[:, None], -LONGEST, LONGEST) + LONGEST
        for n in range(self.config.layers):
            layer = f"layers.{n}"
            x = x + self._dense(f"{layer}.answer", self._attended(layer, x, apart))
            wide = np.maximum(self._dense(f"{layer}.widen", self._scaled(f"{layer}.after", x)), 0)
            x = x + self._dense(f"{layer}.narrow", wide)
        return self._dense("tell", self._scaled("last", x[PAST : -TARGET_FRAMES + 1]))

    def _attended(self, layer: str, x: Array, apart: Array) -> Array:
        heads, (frames, width) = self.config.heads, x.shape
        asked = self._dense(f"{layer}.ask", self._scaled(f"{layer}.before", x))
        queries, keys, values = asked.reshape(frames, 3, heads, -1).transpose(1, 2, 0, 3)
        score = queries @ keys.transpose(0, 2, 1) / np.float32(math.sqrt(width // heads))
        score = score + self._p[f"{layer}.near"][:, apart]
        share = np.exp(score - score.max(-1, keepdims=True))
        found = share / share.sum(-1, keepdims=True) @ values
        return found.transpose(1, 0, 2).reshape(frames, width)

    def _scaled(self, name: str, x: Array) -> Array:
        off = x - x.mean(-1, keepdims=True)
        even = off / np.sqrt((off**2).mean(-1, keepdims=True) + np.float32(_SMALL))
        return np.asarray(even * self._p[f"{name}.weight"] + self._p[f"{name}.bias"])

    def _dense(self, name: str, x: Array) -> Array:
        return np.asarray(x @ self._p[f"{name}.weight"].T + self._p[f"{name}.bias"])


__all__ = ["NumpyDelta"]
