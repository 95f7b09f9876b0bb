"""The controller's network stepped in numpy alone."""

from __future__ import annotations

import numpy as np

from nsm_core.model.handling.layout import GATE, UNSEEN
from nsm_core.rotations import Array

from .handling_config import FAR, HandlingConfig
from .layers_numpy import dense, elu, softmax
from .nsm_numpy import mixed
from .protocol import Weights


class NumpyHandling:
    """As its torch module."""

    def __init__(self, config: HandlingConfig, weights: Weights) -> None:
        """``weights`` hold every array of ``config.shapes()``."""
        p, self.config, self._statistics = weights.parameters, config, weights.statistics
        self._gating = [(p[f"gating.{n}.weight"], p[f"gating.{n}.bias"]) for n in range(3)]
        self._layers = [(p[f"layers.{n}.weight"], p[f"layers.{n}.bias"]) for n in range(3)]

    def outputs(self, inputs: Array) -> Array:
        """Outputs (B, OUTPUT.size) of inputs (B, INPUT.size), both in physical units."""
        s = self._statistics
        x = np.clip((inputs - s["input_mean"]) / s["input_std"], -FAR, FAR).astype(np.float32)
        if not self.config.goal_phase:
            x[:, UNSEEN] = 0
        h = x[:, GATE]
        for weight, bias in self._gating[:-1]:
            h = elu(dense(weight, bias, h))
        y = mixed(self._layers, x, softmax(dense(*self._gating[-1], h)))
        return y * s["output_std"] + s["output_mean"]


__all__ = ["NumpyHandling"]
