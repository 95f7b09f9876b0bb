"""The multi-layer perceptron stepped in numpy alone."""

from __future__ import annotations

from nsm_core.rotations import Array

from .config import Memory
from .encoded_numpy import NumpyEncoded
from .layers_numpy import elu


class NumpyMlp(NumpyEncoded):
    """As its torch module; without memory."""

    def predict(self, encoded: Array, memory: Memory) -> tuple[Array, Memory]:
        """As ``NumpyEncoded.predict``."""
        h = elu(self.layer("layers.0", encoded))
        return self.layer("layers.2", elu(self.layer("layers.1", h))), {}
