"""The rivals whose weights are blended, stepped in numpy alone."""

from __future__ import annotations

import numpy as np

from nsm_core.model.features.layout import Inputs
from nsm_core.rotations import Array

from .gate_features import FOOT_VELOCITIES, catmull_rom, concatenated, phases
from .nsm_numpy import NumpyNsm


class NumpyPfnn(NumpyNsm):
    """As its torch module."""

    def coefficients(self, inputs: Inputs[Array]) -> Array:
        """Of the spline at the present phase."""
        phase = phases(np, *self.physical(inputs))
        return catmull_rom(np, phase, np.arange(self.config.experts, dtype=np.float32))


class NumpyMann(NumpyNsm):
    """As its torch module."""

    def coefficients(self, inputs: Inputs[Array]) -> Array:
        """Of the gating network, by the feet's velocities."""
        return self.gate(inputs.features[:, FOOT_VELOCITIES])


class NumpyConcatenated(NumpyNsm):
    """As its torch module."""

    def coefficients(self, inputs: Inputs[Array]) -> Array:
        """Of the gating network, by what stands beside the phase."""
        return self.gate(concatenated(np, *self.physical(inputs)))
