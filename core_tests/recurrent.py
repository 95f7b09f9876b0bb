"""A small network with memory, complete in all its forms, that exists in the tests alone: h' = tanh(W x + U h
+ b), y = V h' + d.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from nsm_core.model.features.layout import Inputs
from nsm_core.model.networks.config import NetworkConfig
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.registry import NetworkKind


@dataclass(frozen=True)
class ElmanConfig(NetworkConfig):
    """``recall`` is the share of the last frame's memory that goes on beside what is learned."""

    network: ClassVar[str] = "elman"

    hidden: int = 24
    recall: float = 0.5

    @property
    def memory_sizes(self) -> dict[str, int]:
        return {"hidden": self.hidden, "frames": 1}

    def parameter_shapes(self) -> dict[str, tuple[int, ...]]:
        h = self.hidden
        return {
            "read.weight": (h, self.inputs), "read.bias": (h,), "again.weight": (h, h),
            "tell.weight": (self.outputs, h), "tell.bias": (self.outputs,),
        }  # fmt: skip


class NumpyElman:
    """It steps without torch."""

    backend = "numpy"

    def __init__(self, config: ElmanConfig, weights: Weights) -> None:
        self.config, self.metadata, self._p, self._s = (
            config,
            weights.metadata,
            weights.parameters,
            weights.statistics,
        )

    def start(self, batch: int = 1):
        return self.config.start(batch)

    def step(self, inputs, memory):
        x, _ = self.config.checked(inputs, memory)
        p, s = self._p, self._s
        x = (x - s["input_mean"]) / s["input_std"]
        h = np.tanh(x @ p["read.weight"].T + p["read.bias"] + memory["hidden"] @ p["again.weight"].T)
        h = h + np.float32(self.config.recall) * memory["hidden"]
        y = h @ p["tell.weight"].T + p["tell.bias"]
        return y * s["output_std"] + s["output_mean"], {"hidden": h, "frames": memory["frames"] + 1}, {}


def _module(config: ElmanConfig):
    import torch
    from torch import nn

    from nsm_core.model.networks.trainable import Trainable

    class Elman(Trainable):
        def __init__(self) -> None:
            super().__init__(config)
            self.read, self.again = (
                nn.Linear(config.inputs, config.hidden),
                nn.Linear(config.hidden, config.hidden, bias=False),
            )
            self.tell = nn.Linear(config.hidden, config.outputs)

        def forward(self, inputs: Inputs, memory):
            h = (
                torch.tanh(self.read(inputs.features) + self.again(memory["hidden"]))
                + config.recall * memory["hidden"]
            )
            return self.tell(h).float(), {"hidden": h, "frames": memory["frames"] + 1}, {}

    return Elman()


ELMAN = NetworkKind(ElmanConfig, NumpyElman, _module)
