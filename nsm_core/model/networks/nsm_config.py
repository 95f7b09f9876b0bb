"""Sizes of the Neural State Machine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .encoded_config import EncodedConfig, Shapes, chain


@dataclass(frozen=True)
class NsmConfig(EncodedConfig):
    """Sizes of an NSM; the defaults are the paper's network on this project's feature layout."""

    network: ClassVar[str] = "nsm"

    gating_hidden: int = 128
    experts: int = 8

    @property
    def info_sizes(self) -> dict[str, int]:
        """Coefficients by which the experts were blended."""
        return {"experts": self.experts}

    @property
    def gates(self) -> int:
        """Width of what the gating network is fed: the gating features."""
        return self.gating

    def parameter_shapes(self) -> Shapes:
        """Names and shapes of all parameters; layers of experts are (K, out, in)."""
        gating = (self.gates, self.gating_hidden, self.gating_hidden, self.experts)
        return self.encoder_shapes() | chain("gating", gating) | self.expert_shapes()

    def expert_shapes(self) -> Shapes:
        """Names and shapes of the prediction network's parameters."""
        return chain("experts", (sum(self.encoded), self.hidden, self.hidden, self.outputs), (self.experts,))
