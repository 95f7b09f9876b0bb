"""Sizes of the Neural State Machine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .config import NetworkConfig


@dataclass(frozen=True)
class NsmConfig(NetworkConfig):
    """Sizes of an NSM; the defaults are the paper's network on this project's feature layout."""

    network: ClassVar[str] = "nsm"

    encoder_frame: int = 512
    encoder_goal: int = 128
    encoder_environment: int = 512
    encoder_interaction: int = 256
    gating_hidden: int = 128
    hidden: int = 512
    experts: int = 8
    dropout: float = 0.0

    @property
    def encoded(self) -> tuple[int, int, int, int]:
        """Widths of the four encodings, in the order of ``parts``."""
        return self.encoder_frame, self.encoder_goal, self.encoder_environment, self.encoder_interaction

    @property
    def info_sizes(self) -> dict[str, int]:
        """Coefficients by which the experts were blended."""
        return {"experts": self.experts}

    def parameter_shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters; layers of experts are (K, out, in)."""
        shapes: dict[str, tuple[int, ...]] = {}

        def chain(prefix: str, widths: tuple[int, ...], lead: tuple[int, ...] = ()) -> None:
            for i, (inputs, outputs) in enumerate(zip(widths[:-1], widths[1:], strict=True)):
                shapes[f"{prefix}.{i}.weight"] = (*lead, outputs, inputs)
                shapes[f"{prefix}.{i}.bias"] = (*lead, outputs)

        for e, (part, encoded) in enumerate(zip(self.parts, self.encoded, strict=True)):
            chain(f"encoders.{e}.layers", (part, encoded, encoded))
        chain("gating", (self.gating, self.gating_hidden, self.gating_hidden, self.experts))
        chain("experts", (sum(self.encoded), self.hidden, self.hidden, self.outputs), (self.experts,))
        return shapes
