"""What a network is to everything that steps one: control, evaluation and bench know this protocol and no
network.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from nsm_core.model.features.layout import Inputs
from nsm_core.rotations import Array

from .config import Memory, NetworkConfig

# What a step tells of itself, by name, (B, size) each, as ``NetworkConfig.info_sizes`` says.
Info = dict[str, Array]


@dataclass(frozen=True)
class Weights:
    """What a weights file holds: parameters and statistics as float32 arrays by name, and its metadata."""

    parameters: dict[str, Array]
    statistics: dict[str, Array]
    metadata: dict[str, Any] = field(default_factory=dict)

    @property
    def network(self) -> str:
        """Name of the network in the registry; files of before there were several hold the NSM and do not say
        so.
        """
        return self.metadata.get("network", "nsm")

    @property
    def config(self) -> dict[str, Any]:
        """Sizes of the network, as ``NetworkConfig.to_dict`` gives them."""
        return self.metadata["config"]


class Model(Protocol):
    """A trained network, stepped a frame at a time for a batch of B characters; a take is a batch of one.

    Outputs of the same inputs and memory are the same, and neither is changed: whoever steps keeps the
    memory, one row a character, and may therefore branch, go back or put rows of several batches together.
    """

    backend: str  # "numpy" or "torch"
    metadata: dict[str, Any]  # of the weights file: stance, actions, credits

    @property
    def config(self) -> NetworkConfig:
        """Sizes, of the network's own class."""
        ...

    def start(self, batch: int = 1) -> Memory:
        """Memory of ``batch`` characters before their first frame; empty for a network without memory."""
        ...

    def step(self, inputs: Inputs[Array], memory: Memory) -> tuple[Array, Memory, Info]:
        """Predict the next frame: outputs (B, outputs), the memory for the next step, and what the step tells
        of itself, all float32.

        ``inputs`` are those of ``features.codec.build_inputs``: features (B, inputs) and gating (B, gating)
        in physical units (metres, seconds, the root's frame), as are the outputs, for
        ``features.codec.read_outputs``; normalisation happens inside.  ``memory`` is what ``start`` or the
        last step gave for these characters.  Raises ValueError on other shapes.
        """
        ...
