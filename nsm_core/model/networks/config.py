"""Sizes of a network, readable without torch."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any


@dataclass(frozen=True)
class NsmConfig:
    """Sizes of an NSM; the defaults are the paper's network on this project's feature layout."""

    frame: int = 419
    goal: int = 143
    environment: int = 1408
    interaction: int = 2048
    gating: int = 650
    outputs: int = 605
    encoder_frame: int = 512
    encoder_goal: int = 128
    encoder_environment: int = 512
    encoder_interaction: int = 256
    gating_hidden: int = 128
    hidden: int = 512
    experts: int = 8
    dropout: float = 0.0

    @property
    def parts(self) -> tuple[int, int, int, int]:
        """Widths of the input's four parts, in order: frame, goal, environment, interaction."""
        return self.frame, self.goal, self.environment, self.interaction

    @property
    def encoded(self) -> tuple[int, int, int, int]:
        """Widths of the four encodings, in the order of ``parts``."""
        return self.encoder_frame, self.encoder_goal, self.encoder_environment, self.encoder_interaction

    @property
    def inputs(self) -> int:
        """Width of the input vector X."""
        return sum(self.parts)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> NsmConfig:
        """Read back what ``to_dict`` wrote; unknown keys are ignored."""
        known = {f.name for f in fields(cls)}
        return cls(**{k: v for k, v in values.items() if k in known})
