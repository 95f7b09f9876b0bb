"""A trained network that fills gaps, of whichever kind, in numpy over one (papers/001 section 4.1)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.skeleton import HIPS, J
from nsm_core.model.networks.delta_config import DeltaConfig
from nsm_core.model.networks.delta_numpy import NumpyDelta
from nsm_core.model.networks.gap_config import GapConfig
from nsm_core.model.networks.gap_kinds import transition_config
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.rtn_numpy import NumpyTransition
from nsm_core.model.transitions.layout import PAST, layout_description, patch_grid
from nsm_core.model.transitions.representation import facing, turned
from nsm_core.rotations import Array, rotate_planar

from .network_of import require_arrays
from .weights_file import load_weights

# Deviation of a variation, in units of the target's encoding: four times the noise of training, to which a
# network learns to be deaf.
VARIED = 2.0
FILL = Path(__file__).parents[2] / "weights" / "fill.npz"
Ground = Callable[[Array], Array]  # world places (N, 2) -> heights (N,), metres


class TransitionModel:
    """A network and what its numbers mean; ``metadata`` is that of the weights file."""

    def __init__(self, config: GapConfig, weights: Weights) -> None:
        self.config, self.metadata = config, weights.metadata
        kind = NumpyDelta if isinstance(config, DeltaConfig) else NumpyTransition
        self._net = kind(config, weights)  # type: ignore[arg-type]

    def predict(self, past: Array, target: Array, frames: int, ground: Ground, seed: int = 0) -> Array:
        """World joints (frames + 1, 23, 3), metres, after ``past`` (1 to PAST, 23, 3), the last of them of
        the frame of ``target`` (1 or 2, 23, 3), which is told and not given: nothing is corrected yet.

        A past that is too short goes on backwards as it begins, and one target frame is at rest.  ``seed``
        other than 0 varies what is made of the target.
        """
        whole = np.concatenate((extended(past), target[:2], target[-1:]))[: PAST + 2].astype(np.float64)
        middle = whole[PAST - 1, HIPS, :2].copy()
        angle = -facing(whole[PAST - 1]) if self.config.faced else np.zeros(())
        joints = turned(whole, middle, angle).astype(np.float32)
        grid = patch_grid()

        def patches(hips: Array) -> Array:
            places = rotate_planar((hips[:, None, :2] + grid).reshape(-1, 2), -angle) + middle
            return (ground(places).reshape(len(hips), -1) - hips[:, 2:]).astype(np.float32)

        drawn = None
        if seed and self.config.varied:
            drawn = np.random.default_rng(seed).normal(0, VARIED, self.config.varied).astype(np.float32)
        told = self._net.fill(joints, frames, patches if self.config.terrain else None, drawn)
        out = told.reshape(-1, J, 3).astype(np.float64)
        back = rotate_planar(out, -angle)
        back[..., :2] += middle
        return back


def extended(past: Array) -> Array:
    """PAST frames (PAST, 23, 3) of the last ones of ``past`` (T, 23, 3), before which the first pose comes on
    its way at the speed that it has.
    """
    past = np.asarray(past, dtype=np.float64)[-PAST:]
    lacking = PAST - len(past)
    pace = past[1, HIPS] - past[0, HIPS] if len(past) > 1 else np.zeros(3)
    before = past[0] - np.arange(lacking, 0, -1)[:, None, None] * pace
    return np.concatenate((before, past))


def load_transitions(path: str | Path | None = None) -> TransitionModel:
    """Load a weights file, the bundled one without ``path``; WeightsError where it cannot be used."""
    return transitions_of(load_weights(path or FILL, layout_description(), transition_config))


def transitions_of(weights: Weights) -> TransitionModel:
    """Model of loaded weights; errors as of ``load_transitions``."""
    config: Any = transition_config(weights.network).from_dict(weights.config)
    require_arrays(weights, config.shapes())
    return TransitionModel(config, weights)


__all__ = ["FILL", "TransitionModel", "extended", "load_transitions", "transitions_of"]
