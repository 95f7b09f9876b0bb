"""The Neural State Machine stepped in numpy alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.model.features.layout import Inputs
from nsm_core.rotations import Array
from nsm_core.threads import one_thread

from .config import Memory
from .layers_numpy import dense, elu, softmax
from .nsm_config import NsmConfig
from .protocol import Info, Weights

# Experts with a smaller coefficient are not read for a single character: their share of the output stays
# below the rounding of single precision by which the back ends differ, and reading weights is what a step
# costs.
NEGLIGIBLE = 1e-6


class NumpyNsm:
    """The network in numpy alone, single precision; a ``Model`` without memory."""

    backend = "numpy"

    def __init__(self, config: NsmConfig, weights: Weights) -> None:
        """``weights`` hold every array of ``config.shapes()``."""
        self.config, self.metadata = config, weights.metadata
        p = {name: np.ascontiguousarray(values) for name, values in weights.parameters.items()}
        self._statistics = weights.statistics
        self._encoders = [
            [(p[f"encoders.{e}.layers.{i}.weight"], p[f"encoders.{e}.layers.{i}.bias"]) for i in range(2)]
            for e in range(4)
        ]
        self._gating = [
            (p[f"gating.{i}.weight"], p[f"gating.{i}.bias"]) for i in range(3) if f"gating.{i}.weight" in p
        ]
        self._experts = [(p[f"experts.{i}.weight"], p[f"experts.{i}.bias"]) for i in range(3)]
        self._bounds = np.cumsum(self.config.parts)[:-1]

    def start(self, batch: int = 1) -> Memory:
        """Remember nothing."""
        return self.config.start(batch)

    def step(self, inputs: Inputs[Array], memory: Memory) -> tuple[Array, Memory, Info]:
        """Predict as ``Model.step`` says; the info "experts" are the blending coefficients (B, K)."""
        x, gating = self.config.checked(inputs, memory)
        if len(x) > 8:
            y, coefficients = self._predict(x, gating)
        else:
            with one_thread():
                y, coefficients = self._predict(x, gating)
        return y, {}, {"experts": coefficients}

    def _predict(self, x: Array, gating: Array) -> tuple[Array, Array]:
        s = self._statistics
        normalised = Inputs(
            (x - s["input_mean"]) / s["input_std"], (gating - s["gating_mean"]) / s["gating_std"]
        )
        coefficients = self.coefficients(normalised)
        h = self.mix(self.encode(normalised.features), coefficients)
        return h * s["output_std"] + s["output_mean"], coefficients

    def coefficients(self, inputs: Inputs[Array]) -> Array:
        """Coefficients (B, K) by which normalised inputs blend the experts."""
        return self.gate(inputs.gating)

    def physical(self, inputs: Inputs[Array]) -> Inputs[Array]:
        """Normalised inputs in physical units again."""
        s = self._statistics
        return Inputs(
            inputs.features * s["input_std"] + s["input_mean"],
            inputs.gating * s["gating_std"] + s["gating_mean"],
        )

    def gate(self, gating: Array) -> Array:
        """Coefficients (B, K) of what the gating network is fed, (B, gates); papers/000 section 3.2."""
        h = gating
        for weight, bias in self._gating[:-1]:
            h = elu(dense(weight, bias, h))
        return softmax(dense(*self._gating[-1], h))

    def encode(self, x: Array) -> Array:
        """Four encodings side by side, (B, sum of encoders), of normalised inputs (B, inputs)."""
        encodings = []
        for layers, h in zip(self._encoders, np.split(x, self._bounds, axis=1), strict=True):
            for weight, bias in layers:
                h = elu(dense(weight, bias, h))
            encodings.append(h)
        return np.concatenate(encodings, axis=1)

    def mix(self, encoded: Array, coefficients: Array) -> Array:
        """Normalised outputs (B, outputs) of the prediction network blended by ``coefficients`` (B, K)."""
        return mixed(self._experts, encoded, coefficients)


def mixed(experts: Sequence[tuple[Array, Array]], h: Array, coefficients: Array) -> Array:
    """Outputs (B, out) of layers whose weights (K, out, in) and biases (K, out) are blended by
    ``coefficients`` (B, K), ELU between them.
    """
    blend = _mix_one if len(h) == 1 else _mix_many
    for i, (weight, bias) in enumerate(experts):
        h = blend(weight, h, coefficients) + coefficients @ bias
        h = elu(h) if i < len(experts) - 1 else h
    return h


def _mix_one(weight: Array, h: Array, coefficients: Array) -> Array:
    """Blend the experts' products (K, out, in) for one character: only experts that count are read."""
    c, v = coefficients[0], h[0]
    active = np.flatnonzero(np.abs(c) > NEGLIGIBLE)
    # None counts where the coefficients are not numbers: let that show in the result.
    if len(active) in (0, len(c)):
        products = (weight.reshape(-1, weight.shape[2]) @ v).reshape(len(c), -1)
        return (c @ products)[None]
    return sum(c[k] * (weight[k] @ v) for k in active)[None]


def _mix_many(weight: Array, h: Array, coefficients: Array) -> Array:
    """Blend the experts' products (K, out, in) for a batch: one matrix product over all experts."""
    experts, out, inputs = weight.shape
    products = (h @ weight.reshape(-1, inputs).T).reshape(len(h), experts, out)
    return (coefficients[:, None, :] @ products)[:, 0]
