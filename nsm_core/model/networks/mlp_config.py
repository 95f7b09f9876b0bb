"""Sizes of the multi-layer perceptron."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .encoded_config import AllEncodedConfig, Shapes, chain


@dataclass(frozen=True)
class MlpConfig(AllEncodedConfig):
    """Sizes of an MLP: the defaults have as many parameters as the Neural State Machine (12.5 million)."""

    network: ClassVar[str] = "mlp"

    hidden: int = 2320

    def parameter_shapes(self) -> Shapes:
        """Names and shapes of all parameters."""
        widths = (sum(self.encoded), self.hidden, self.hidden, self.outputs)
        return self.encoder_shapes() | chain("layers", widths)
