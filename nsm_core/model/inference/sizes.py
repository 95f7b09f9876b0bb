"""What sizes a network's arrays have, and whether inputs and weights have them."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from nsm_core.errors import WeightsError
from nsm_core.model.features.layout import GATING, INPUT, OUTPUT
from nsm_core.model.networks.config import NsmConfig
from nsm_core.rotations import Array
from nsm_core.validate import number, whole

from .weights_file import Weights

MOST_WIDE = 100_000  # a layer's width; the paper's widest has 2,048


def layer_widths() -> tuple[int, ...]:
    """Widths of the features: the input's parts, gating and outputs."""
    return (*(part.stop - part.start for part in INPUT.slices.values()), GATING.size, OUTPUT.size)


def config_of(weights: Weights) -> NsmConfig:
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


def checked_inputs(x: Array, gating: Array, config: NsmConfig) -> tuple[Array, Array]:
    x = np.ascontiguousarray(x, dtype=np.float32)
    gating = np.ascontiguousarray(gating, dtype=np.float32)
    if x.ndim != 2 or x.shape[1] != config.inputs or gating.shape != (len(x), config.gating):
        raise ValueError(f"predict needs x (B, {config.inputs}) and gating (B, {config.gating}), got {x.shape} and {gating.shape}")
    return x, gating
