"""Step a trained network: one protocol, a numpy back end for Blender and a torch one, equal but for rounding."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from nsm_core.errors import WeightsError
from nsm_core.model.features.codec import GATING, INPUT, OUTPUT, layout_description
from nsm_core.model.networks.config import NsmConfig
from nsm_core.threads import one_thread
from nsm_core.validate import number, whole

from .weights_file import Weights, load_weights

Array = np.ndarray

BUNDLED = Path(__file__).parents[2] / "weights" / "nsm.npz"
BACKENDS = ("auto", "numpy", "torch")
# Experts with a smaller coefficient are not read for a single character: their share of the output stays
# below the rounding of single precision by which the back ends differ, and reading weights is what a step costs.
NEGLIGIBLE = 1e-6
MOST_WIDE = 100_000  # a layer's width; the paper's widest has 2,048


class Model(Protocol):
    """A network that can be stepped; features go in and out in physical units."""

    backend: str
    config: NsmConfig
    metadata: dict[str, Any]

    def predict(self, x: Array, gating: Array) -> tuple[Array, Array]:
        """Predict outputs (B, outputs) and expert coefficients (B, K), float32, from un-normalised inputs.

        ``x`` is (B, inputs): frame, goal, environment, interaction; ``gating`` is (B, gating).
        Normalisation happens inside (papers/000 section 3).  Raises ValueError on other widths.
        """
        ...


class NumpyModel:
    """The network in numpy alone, single precision."""

    backend = "numpy"

    def __init__(self, weights: Weights) -> None:
        self.config, self.metadata = _config_of(weights), weights.metadata
        p = {name: np.ascontiguousarray(values) for name, values in weights.parameters.items()}
        self._statistics = weights.statistics
        self._encoders = [
            [(p[f"encoders.{e}.layers.{i}.weight"], p[f"encoders.{e}.layers.{i}.bias"]) for i in range(2)] for e in range(4)
        ]
        self._gating = [(p[f"gating.{i}.weight"], p[f"gating.{i}.bias"]) for i in range(3)]
        self._experts = [(p[f"experts.{i}.weight"], p[f"experts.{i}.bias"]) for i in range(3)]
        self._bounds = np.cumsum(self.config.parts)[:-1]

    def predict(self, x: Array, gating: Array) -> tuple[Array, Array]:
        """Predict as ``Model.predict`` says."""
        x, gating = _checked(x, gating, self.config)
        if len(x) > 8:
            return self._predict(x, gating)
        with one_thread():
            return self._predict(x, gating)

    def _predict(self, x: Array, gating: Array) -> tuple[Array, Array]:
        s = self._statistics
        coefficients = self.gate((gating - s["gating_mean"]) / s["gating_std"])
        h = self.mix(self.encode((x - s["input_mean"]) / s["input_std"]), coefficients)
        return h * s["output_std"] + s["output_mean"], coefficients

    def gate(self, gating: Array) -> Array:
        """Coefficients (B, K) of normalised gating features (B, gating); papers/000 section 3.2."""
        h = gating
        for weight, bias in self._gating[:-1]:
            h = _elu(_dense(weight, bias, h))
        return _softmax(_dense(*self._gating[-1], h))

    def encode(self, x: Array) -> Array:
        """Four encodings side by side, (B, sum of encoders), of normalised inputs (B, inputs)."""
        encodings = []
        for layers, h in zip(self._encoders, np.split(x, self._bounds, axis=1), strict=True):
            for weight, bias in layers:
                h = _elu(_dense(weight, bias, h))
            encodings.append(h)
        return np.concatenate(encodings, axis=1)

    def mix(self, encoded: Array, coefficients: Array) -> Array:
        """Normalised outputs (B, outputs) of the prediction network blended by ``coefficients`` (B, K)."""
        h, blend = encoded, _mix_one if len(encoded) == 1 else _mix_many
        for i, (weight, bias) in enumerate(self._experts):
            h = blend(weight, h, coefficients) + coefficients @ bias
            h = _elu(h) if i < len(self._experts) - 1 else h
        return h


class TorchModel:
    """The training module itself, single precision; raises ImportError where torch is missing."""

    backend = "torch"

    def __init__(self, weights: Weights) -> None:
        import torch

        from nsm_core.model.networks.nsm import NSM

        self.config, self.metadata = _config_of(weights), weights.metadata
        self._torch = torch
        self._net = NSM(self.config).eval()
        state = {name: torch.from_numpy(values) for name, values in {**weights.parameters, **weights.statistics}.items()}
        self._net.load_state_dict(state)

    def predict(self, x: Array, gating: Array) -> tuple[Array, Array]:
        """Predict as ``Model.predict`` says."""
        x, gating = _checked(x, gating, self.config)
        with self._torch.inference_mode():
            y, coefficients = self._net.predict(self._torch.from_numpy(x), self._torch.from_numpy(gating))
        return y.numpy(), coefficients.numpy()


def load_model(path: str | Path | None = None, backend: str = "auto") -> Model:
    """Load a weights file, the bundled one without ``path``, for stepping.

    ``backend`` is "numpy", "torch" or "auto".  One character a step is bound by reading the weights, where numpy needs
    a fifth less time than torch and does not fight over threads, so "auto" means numpy; torch pays off in batches.
    The file's feature layout must be the program's own.  Raises WeightsError on a bad file, or if "torch" is asked for and missing.
    """
    if backend not in BACKENDS:
        raise WeightsError(f"There is no back end {backend}; choose one of {', '.join(BACKENDS)}.")
    model = model_of(load_weights(path or BUNDLED, layout_description()), backend)
    c = model.config
    if (*c.parts, c.gating, c.outputs) != _widths():
        raise WeightsError(f"The weights file's network is of other widths than its features, {_widths()}; copy or train it again.")
    return model


def model_of(weights: Weights, backend: str = "auto") -> Model:
    """Model of loaded weights; back ends and errors as ``load_model``."""
    if backend == "torch":
        try:
            return TorchModel(weights)
        except (ImportError, OSError) as error:  # OSError: a torch whose libraries do not load
            raise WeightsError("PyTorch is not usable here; install it or choose the numpy back end.") from error
    return NumpyModel(weights)


def _widths() -> tuple[int, ...]:
    """Widths of the features: the input's parts, gating and outputs."""
    return (*(part.stop - part.start for part in INPUT.slices.values()), GATING.size, OUTPUT.size)


def _config_of(weights: Weights) -> NsmConfig:
    """Sizes of the network; WeightsError unless every array is there and fits them."""
    config = _sizes(weights)
    expected = expected_shapes(config)
    found = {**weights.parameters, **weights.statistics}
    for name, shape in expected.items():
        if name not in found or found[name].shape != shape:
            has = "is missing" if name not in found else f"has shape {found[name].shape}"
            raise WeightsError(f"The weights file is incomplete: {name} {has} where {shape} is needed; copy or train it again.")
    if len(found) > len(expected):
        odd = next(name for name in found if name not in expected)
        raise WeightsError(f"The weights file holds {odd}, which a network of its sizes has not; copy or train it again.")
    return config


def _sizes(weights: Weights) -> NsmConfig:
    """Sizes that a weights file tells of its network, each a whole number that a network can have."""
    told = weights.config
    try:
        for size in fields(NsmConfig):
            what = f"'{size.name}' of the network's sizes"
            if size.name == "dropout":
                number(told.get(size.name, 0.0), what, WeightsError, 0, 1)
            elif size.name in told:
                whole(told[size.name], what, WeightsError, 1, MOST_WIDE)
    except WeightsError as error:
        raise WeightsError(f"In the weights file, {str(error).removesuffix('.')}; copy or train it again.") from error
    return NsmConfig.from_dict(told)


def expected_shapes(c: NsmConfig) -> dict[str, tuple[int, ...]]:
    """Names and shapes of all parameters and statistics of a network of these sizes."""
    shapes: dict[str, tuple[int, ...]] = {}

    def chain(prefix: str, widths: tuple[int, ...], lead: tuple[int, ...] = ()) -> None:
        for i, (inputs, outputs) in enumerate(zip(widths[:-1], widths[1:], strict=True)):
            shapes[f"{prefix}.{i}.weight"] = (*lead, outputs, inputs)
            shapes[f"{prefix}.{i}.bias"] = (*lead, outputs)

    for e, (part, encoded) in enumerate(zip(c.parts, c.encoded, strict=True)):
        chain(f"encoders.{e}.layers", (part, encoded, encoded))
    chain("gating", (c.gating, c.gating_hidden, c.gating_hidden, c.experts))
    chain("experts", (sum(c.encoded), c.hidden, c.hidden, c.outputs), (c.experts,))
    for name, size in (("input", c.inputs), ("gating", c.gating), ("output", c.outputs)):
        shapes[f"{name}_mean"] = shapes[f"{name}_std"] = (size,)
    return shapes


def _checked(x: Array, gating: Array, config: NsmConfig) -> tuple[Array, Array]:
    x = np.ascontiguousarray(x, dtype=np.float32)
    gating = np.ascontiguousarray(gating, dtype=np.float32)
    if x.ndim != 2 or x.shape[1] != config.inputs or gating.shape != (len(x), config.gating):
        raise ValueError(
            f"predict needs x (B, {config.inputs}) and gating (B, {config.gating}), got {x.shape} and {gating.shape}"
        )
    return x, gating


def _dense(weight: Array, bias: Array, h: Array) -> Array:
    return h @ weight.T + bias


def _elu(x: Array) -> Array:
    return np.where(x > 0, x, np.expm1(np.minimum(x, 0)))


def _softmax(x: Array) -> Array:
    e = np.exp(x - x.max(axis=1, keepdims=True))
    return e / e.sum(axis=1, keepdims=True)


def _mix_one(weight: Array, h: Array, coefficients: Array) -> Array:
    """Blend the experts' products (K, out, in) for one character: only experts that count are read."""
    c, v = coefficients[0], h[0]
    active = np.flatnonzero(c > NEGLIGIBLE)
    if len(active) in (0, len(c)):  # none counts where the coefficients are not numbers: let that show in the result
        products = (weight.reshape(-1, weight.shape[2]) @ v).reshape(len(c), -1)
        return (c @ products)[None]
    return sum(c[k] * (weight[k] @ v) for k in active)[None]


def _mix_many(weight: Array, h: Array, coefficients: Array) -> Array:
    """Blend the experts' products (K, out, in) for a batch: one matrix product over all experts."""
    experts, out, inputs = weight.shape
    products = (h @ weight.reshape(-1, inputs).T).reshape(len(h), experts, out)
    return (coefficients[:, None, :] @ products)[:, 0]
