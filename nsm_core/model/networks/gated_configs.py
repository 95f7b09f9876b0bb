"""Sizes of the rivals whose weights are blended: PFNN, MANN, and the Neural State Machine by another gate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from nsm_core.model.features.state import KEYS

from .encoded_config import Shapes
from .gate_features import FOOT_VELOCITIES, PER_KEY
from .nsm_config import NsmConfig


@dataclass(frozen=True)
class PfnnConfig(NsmConfig):
    """Sizes of a PFNN: ``experts`` are the control points of its spline.  The defaults have as many
    parameters as the Neural State Machine (12.5 million).
    """

    network: ClassVar[str] = "pfnn"

    hidden: int = 896
    experts: int = 4

    def parameter_shapes(self) -> Shapes:
        """Names and shapes of all parameters; there is no gating network."""
        return self.encoder_shapes() | self.expert_shapes()


@dataclass(frozen=True)
class MannConfig(NsmConfig):
    """Sizes of a MANN (12.5 million parameters): the Neural State Machine gated by the feet's velocities."""

    network: ClassVar[str] = "mann"

    @property
    def gates(self) -> int:
        """Width of what the gating network is fed: velocities of ankles and toes."""
        return len(FOOT_VELOCITIES)


@dataclass(frozen=True)
class ConcatenatedConfig(NsmConfig):
    """Sizes of the Neural State Machine whose gating features stand beside the phase (papers/000 Fig. 12)."""

    network: ClassVar[str] = "nsm_concatenated"

    @property
    def gates(self) -> int:
        """Width of what the gating network is fed."""
        return KEYS * PER_KEY
