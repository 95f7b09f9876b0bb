"""Sizes of the encoders that all networks of the comparison read their inputs through."""

from __future__ import annotations

from dataclasses import dataclass

from .config import NetworkConfig

Shapes = dict[str, tuple[int, ...]]


def chain(prefix: str, widths: tuple[int, ...], lead: tuple[int, ...] = ()) -> Shapes:
    """Names and shapes of dense layers of these ``widths`` one after the other; of experts with ``lead``
    (K,).
    """
    shapes: Shapes = {}
    for i, (inputs, outputs) in enumerate(zip(widths[:-1], widths[1:], strict=True)):
        shapes[f"{prefix}.{i}.weight"] = (*lead, outputs, inputs)
        shapes[f"{prefix}.{i}.bias"] = (*lead, outputs)
    return shapes


@dataclass(frozen=True)
class EncodedConfig(NetworkConfig):
    """Sizes of a network that encodes each part of its input by itself (papers/000 equation 2)."""

    encoder_frame: int = 512
    encoder_goal: int = 128
    encoder_environment: int = 512
    encoder_interaction: int = 256
    hidden: int = 512
    dropout: float = 0.0

    @property
    def encoded(self) -> tuple[int, ...]:
        """Widths of the encodings, in the order of ``read``."""
        return self.encoder_frame, self.encoder_goal, self.encoder_environment, self.encoder_interaction

    @property
    def read(self) -> tuple[int, ...]:
        """Widths of what is encoded: the input's four parts."""
        return self.parts

    def encoder_shapes(self) -> Shapes:
        """Names and shapes of the encoders' parameters: two dense layers each."""
        shapes: Shapes = {}
        for e, (part, encoded) in enumerate(zip(self.read, self.encoded, strict=True)):
            shapes |= chain(f"encoders.{e}.layers", (part, encoded, encoded))
        return shapes


@dataclass(frozen=True)
class AllEncodedConfig(EncodedConfig):
    """Sizes of a network that does not gate and therefore encodes the gating features like the other parts:
    it knows all that the Neural State Machine knows, phase and goal distances among it.
    """

    encoder_gating: int = 128

    @property
    def encoded(self) -> tuple[int, ...]:
        """Widths of the encodings, that of the gating features last."""
        return *super().encoded, self.encoder_gating

    @property
    def read(self) -> tuple[int, ...]:
        """Widths of what is encoded: the input's four parts and the gating features."""
        return *self.parts, self.gating
