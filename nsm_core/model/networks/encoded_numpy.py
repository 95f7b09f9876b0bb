"""Networks without experts stepped in numpy alone: encoders, normalisation, and a step that a subclass
completes.
"""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np

from nsm_core.model.features.layout import Inputs
from nsm_core.rotations import Array
from nsm_core.threads import one_thread

from .config import Memory
from .encoded_config import AllEncodedConfig
from .layers_numpy import dense, elu
from .protocol import Info, Weights

FEW = 8  # characters up to which a second thread costs more than it brings


class NumpyEncoded:
    """A network that encodes all its inputs, single precision; a ``Model``."""

    backend = "numpy"

    def __init__(self, config: AllEncodedConfig, weights: Weights) -> None:
        """``weights`` hold every array of ``config.shapes()``."""
        self.config, self.metadata = config, weights.metadata
        self._p = {name: np.ascontiguousarray(values) for name, values in weights.parameters.items()}
        self._statistics = weights.statistics
        self._bounds = np.cumsum(config.read)[:-1]

    def start(self, batch: int = 1) -> Memory:
        """As ``Model.start`` says."""
        return self.config.start(batch)

    def step(self, inputs: Inputs[Array], memory: Memory) -> tuple[Array, Memory, Info]:
        """Predict as ``Model.step`` says."""
        x, gating = self.config.checked(inputs, memory)
        s = self._statistics
        with one_thread() if len(x) <= FEW else nullcontext():
            encoded = self._encode(
                np.concatenate(
                    (
                        (x - s["input_mean"]) / s["input_std"],
                        (gating - s["gating_mean"]) / s["gating_std"],
                    ),
                    axis=1,
                )
            )
            h, memory = self.predict(encoded, memory)
        return h * s["output_std"] + s["output_mean"], memory, {}

    def predict(self, encoded: Array, memory: Memory) -> tuple[Array, Memory]:
        """Normalised outputs (B, outputs) of encodings (B, sum of encoded), and the memory after them."""
        raise NotImplementedError

    def layer(self, name: str, h: Array) -> Array:
        """The dense layer of that name."""
        return dense(self._p[f"{name}.weight"], self._p[f"{name}.bias"], h)

    def _encode(self, read: Array) -> Array:
        encodings = []
        for e, h in enumerate(np.split(read, self._bounds, axis=1)):
            for i in range(2):
                h = elu(self.layer(f"encoders.{e}.layers.{i}", h))
            encodings.append(h)
        return np.concatenate(encodings, axis=1)
