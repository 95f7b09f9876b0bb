"""Weights by chance, of the layout that this version writes."""

from __future__ import annotations

import numpy as np

from nsm_core.model.features.layout import layout_description
from nsm_core.model.networks.nsm_config import NsmConfig

LAYOUT = layout_description()


def random_arrays(config: NsmConfig, seed: int = 0) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Parameters and statistics of a network whose signals neither vanish nor explode."""
    rng = np.random.default_rng(seed)
    parameters, statistics = {}, {}
    for name, shape in config.shapes().items():
        if name.endswith("_std"):
            statistics[name] = rng.uniform(0.1, 2, shape).astype(np.float32)
        elif name.endswith("_mean"):
            statistics[name] = rng.normal(size=shape).astype(np.float32)
        elif name.endswith("weight"):
            parameters[name] = rng.normal(size=shape).astype(np.float32) * np.float32(
                1.4 / np.sqrt(shape[-1])
            )
        else:
            parameters[name] = rng.normal(size=shape).astype(np.float32) * np.float32(0.1)
    return parameters, statistics
