"""Sizes of the controller of picking and placing (papers/002 sections 5.1 and 8.1)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from nsm_core.model.handling.layout import CHANNELS, GATE, INPUT, KEY_JOINTS, LABELS, OUTPUT, SOLID

from .sizes import whole_sizes

FAR = 4.0  # deviations from the data's mean beyond which inputs are taken for that far: roll-outs stay sane
# What a key frame is matched by: key joints seen from its root, and the labels that begin and end there.
MATCHED = len(KEY_JOINTS) * SOLID + 2 * LABELS


@dataclass(frozen=True)
class HandlingConfig:
    """``hidden`` units of each of two layers whose weights are blended of ``experts``, ``gate`` units of each
    of two of the gating network; ``goal_phase`` 1 where it is told the goal's phase, else 0.  ``keyframes``
    of the training data are kept with their phases, to be matched.
    """

    network: ClassVar[str] = "handling"

    hidden: int = 512
    experts: int = 4
    gate: int = 128
    goal_phase: int = 1
    keyframes: int = 1

    def parameter_shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters, as in the module's state."""
        shapes: dict[str, tuple[int, ...]] = {}
        wide = (len(GATE), self.gate, self.gate, self.experts)
        for n in range(3):
            shapes[f"gating.{n}.weight"], shapes[f"gating.{n}.bias"] = (wide[n + 1], wide[n]), (wide[n + 1],)
        wide = (INPUT.size, self.hidden, self.hidden, OUTPUT.size)
        for n in range(3):
            shapes[f"layers.{n}.weight"] = (self.experts, wide[n + 1], wide[n])
            shapes[f"layers.{n}.bias"] = (self.experts, wide[n + 1])
        return shapes

    def statistic_shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all statistics: of inputs and outputs, of phases, and the key frames."""
        return {
            "input_mean": (INPUT.size,),
            "input_std": (INPUT.size,),
            "output_mean": (OUTPUT.size,),
            "output_std": (OUTPUT.size,),
            "phase_variance": (3, CHANNELS),
            "key_features": (self.keyframes, MATCHED),
            "key_phases": (self.keyframes, 3, CHANNELS),
        }

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters and statistics."""
        return self.parameter_shapes() | self.statistic_shapes()

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> HandlingConfig:
        """Read back what ``to_dict`` wrote; WeightsError on values that no network has."""
        return cls(**whole_sizes(cls, values, from_zero=("goal_phase",)))


__all__ = ["FAR", "MATCHED", "HandlingConfig"]
