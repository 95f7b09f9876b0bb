"""Sizes of the recurrent networks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .encoded_config import AllEncodedConfig, Shapes, chain

LAYERS = 4


@dataclass(frozen=True)
class LstmConfig(AllEncodedConfig):
    """Sizes of an LSTM; the defaults have as many parameters as the Neural State Machine (12.5 million)."""

    network: ClassVar[str] = "lstm"

    hidden: int = 528

    @property
    def memory_sizes(self) -> dict[str, int]:
        """Hidden and cell state of each recurrent layer."""
        return {f"{kind}{n}": self.hidden for n in range(LAYERS) for kind in ("hidden", "cell")}

    def parameter_shapes(self) -> Shapes:
        """Names and shapes of all parameters; a recurrent layer maps its input and its hidden state side by
        side to the four gates: in, forget, new, out.
        """
        h = self.hidden
        shapes = self.encoder_shapes() | chain("read", (sum(self.encoded), h))
        for n in range(LAYERS):
            shapes |= {f"cells.{n}.weight": (4 * h, 2 * h), f"cells.{n}.bias": (4 * h,)}
        return shapes | chain("tell", (h, h, self.outputs))


@dataclass(frozen=True)
class AutoLstmConfig(LstmConfig):
    """The same network, trained by probabilistic teacher forcing (papers/000 section 7.1)."""

    network: ClassVar[str] = "auto_lstm"
    teacher: ClassVar[float] = 0.5
