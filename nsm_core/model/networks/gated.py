"""The rivals whose weights are blended, as torch modules (papers/000 section 7)."""

from __future__ import annotations

import torch
from torch import Tensor

from nsm_core.model.features.layout import Inputs
from nsm_core.rotations import Array

from .encoded import fold_in
from .gate_features import FOOT_VELOCITIES, catmull_rom, concatenated, phases, plain_columns
from .nsm import NSM, Blended


class PFNN(Blended):
    """Phase-functioned: all weights of the prediction network follow a closed cubic spline over the phase."""

    def coefficients(self, inputs: Inputs[Tensor]) -> Tensor:
        """Of the spline at the present phase; nothing of them is learnt."""
        phase = phases(torch, *self.physical(inputs))
        return catmull_rom(torch, phase, torch.arange(self.config.experts, device=phase.device))


class MANN(NSM):
    """Mode-adaptive: the gating network reads how fast ankles and toes move."""

    def gate_features(self, inputs: Inputs[Tensor]) -> Tensor:
        """Velocities (B, 12) of ankles and toes, normalised."""
        return inputs.features[:, FOOT_VELOCITIES]

    def refit_gate(self, old: dict[str, Tensor]) -> None:
        """As ``Encoded.refit_gate``."""
        ratio, shift = self.change(old, "input")
        first = self.gating[0]
        fold_in(first.weight, first.bias, ratio[FOOT_VELOCITIES], shift[FOOT_VELOCITIES])


class Concatenated(NSM):
    """The Neural State Machine whose labels and goals stand beside the phase instead of being multiplied."""

    def gate_features(self, inputs: Inputs[Tensor]) -> Tensor:
        """Phase, labels, goal distances and angles (B, 351), in physical units."""
        return concatenated(torch, *self.physical(inputs))

    def gate_columns(self, part: str) -> Array:
        """As ``NSM.gate_columns``."""
        return plain_columns(part)

    def refit_gate(self, old: dict[str, Tensor]) -> None:
        """What is fed does not depend on statistics."""
