"""The recurrent networks stepped in numpy alone."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array

from .config import Memory
from .encoded_numpy import NumpyEncoded
from .layers_numpy import elu, sigmoid
from .lstm_config import LAYERS


class NumpyLstm(NumpyEncoded):
    """As its torch module; remembers the state of every recurrent layer."""

    def predict(self, encoded: Array, memory: Memory) -> tuple[Array, Memory]:
        """As ``NumpyEncoded.predict``."""
        x, after = elu(self.layer("read.0", encoded)), Memory()
        for n in range(LAYERS):
            hidden, cell = memory[f"hidden{n}"], memory[f"cell{n}"]
            gates = self.layer(f"cells.{n}", np.concatenate((x, hidden), axis=1))
            come, stay, new, tell = np.split(gates, 4, axis=1)
            cell = sigmoid(stay) * cell + sigmoid(come) * np.tanh(new)
            x = sigmoid(tell) * np.tanh(cell)
            after |= {f"hidden{n}": x, f"cell{n}": cell}
        return self.layer("tell.1", elu(self.layer("tell.0", x))), after
