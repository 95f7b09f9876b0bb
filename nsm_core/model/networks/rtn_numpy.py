"""Transition networks stepped in numpy alone; as their torch module."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array

from .layers_numpy import sigmoid
from .protocol import Weights
from .rtn_config import TransitionConfig

State = tuple[Array, Array]  # output and cell of the recurrent layer, (B, hidden) each
_SLOPE = 0.01


class NumpyTransition:
    """A network of sizes and the weights that fit them; all vectors are standardised, rows are gaps."""

    def __init__(self, config: TransitionConfig, weights: Weights) -> None:
        self.config, self._p = config, weights.parameters
        self.statistics = weights.statistics

    def begin(self, first: Array) -> State:
        """As ``TransitionNetwork.begin``."""
        if self.config.initial == "first_frame":
            state = self._dense("initial.1", _leaky(self._dense("initial.0", first)))
        elif self.config.initial == "common":
            state = np.broadcast_to(self._p["common"], (len(first), 2 * self.config.hidden))
        else:
            state = np.zeros((len(first), 2 * self.config.hidden), np.float32)
        output, cell = np.split(state, 2, axis=-1)
        return output, cell

    def encoded_target(self, target: Array) -> Array | None:
        """As ``TransitionNetwork.encoded_target``."""
        return self._through("target", target) if self.config.future else None

    def step(
        self,
        pose: Array,
        patch: Array | None,
        target: Array | None,
        offset: Array,
        extra: Array | None,
        state: State,
        base: Array,
    ) -> tuple[Array, State]:
        """Predict the next poses (B, 69) of poses (B, 69), patches (B, 169), encoded targets (B, 128),
        offsets (B, 69) and what is added to the future context (B, 256); and the state for the next step.
        A residual network adds to ``base`` (B, 69): the poses themselves, or the next ones on the way home.
        """
        x = pose if patch is None else np.concatenate((pose, patch), axis=-1)
        gates = self._dense("feed", self._through("encode", x) if self.config.encoder else x)
        if target is not None:
            context = np.concatenate((target, self._through("offset", offset)), axis=-1)
            if extra is not None:
                context = context + extra
            gates = gates + context @ self._p["condition.weight"].T
        output, cell = state
        gates = gates + output @ self._p["recur.weight"].T
        come, stay, new, tell = np.split(gates, 4, axis=-1)
        cell = sigmoid(stay) * cell + sigmoid(come) * np.tanh(new)
        output = sigmoid(tell) * np.tanh(cell)
        last = 2 if self.config.decoder else 0
        y = output
        for n in range(last):
            y = _leaky(self._dense(f"decode.{n}", y))
        y = self._dense(f"decode.{last}", y)
        return (base + y if self.config.residual else y), (output, cell)

    def _dense(self, name: str, x: Array) -> Array:
        return np.asarray(x @ self._p[f"{name}.weight"].T + self._p[f"{name}.bias"])

    def _through(self, name: str, x: Array) -> Array:
        return _leaky(self._dense(f"{name}.1", _leaky(self._dense(f"{name}.0", x))))


def _leaky(x: Array) -> Array:
    return np.where(x > 0, x, np.float32(_SLOPE) * x)


__all__ = ["NumpyTransition", "State"]
