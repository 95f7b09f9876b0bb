"""A trained transition network, stepped in numpy over a gap (papers/001 section 4.1)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.skeleton import HIPS, J
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.rtn_config import (
    TransitionConfig,
    arrival_embedding,
    openness,
    transition_config,
)
from nsm_core.model.networks.rtn_numpy import NumpyTransition
from nsm_core.model.transitions.layout import PAST, POSE, layout_description, patch_grid
from nsm_core.model.transitions.representation import facing, poses_of, targets_of, turned, world_joints
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

    def __init__(self, config: TransitionConfig, weights: Weights) -> None:
        self.config, self.metadata = config, weights.metadata
        self._net, self._statistics = NumpyTransition(config, weights), weights.statistics

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

        def patch(root: Array) -> Array | None:
            if not self.config.terrain:
                return None
            places = rotate_planar(root[:2] + grid, -angle) + middle
            return self._standard((ground(places) - root[2]).astype(np.float32)[None], "patch")

        truth = self._standard(poses_of(joints[:PAST]), "pose")
        goal, wanted = joints[PAST].reshape(1, -1), targets_of(joints[PAST:])[None]
        size = POSE.size
        wanted = np.concatenate(
            (self._standard(wanted[:, :size], "pose"), self._standard(wanted[:, size:], "velocity")), axis=1
        )
        encoded = self._net.encoded_target(wanted)
        steps = PAST + frames
        extra = self._extra(steps, seed)
        state = self._net.begin(truth[:1])
        pose, world, told = truth[:1], joints[:1].reshape(1, -1), []
        for t in range(1, steps + 1):
            root = world[0, 3 * HIPS : 3 * HIPS + 3]
            base = pose
            if self.config.homing:
                share = 1 / (steps - t + 1)
                way = (goal[:, 3 * HIPS : 3 * HIPS + 3] - root) * np.float32(share)
                rest = pose[:, 3:] + np.float32(share) * (wanted[:, 3:size] - pose[:, 3:])
                way = (way - self._statistics["pose_mean"][:3]) / self._statistics["pose_std"][:3]
                base = np.concatenate((way, rest), axis=1)
            offset = self._standard(goal - world, "offset")
            pose, state = self._net.step(
                pose, patch(root), encoded, offset, None if extra is None else extra[t - 1 : t], state, base
            )
            if t < PAST:  # what is known is not told again
                pose, world = truth[t : t + 1], joints[t].reshape(1, -1)
                continue
            physical = pose * self._statistics["pose_std"] + self._statistics["pose_mean"]
            world = world_joints(physical, (root + physical[0, :3])[None])
            told.append(world[0])
        out = np.stack(told).reshape(-1, J, 3).astype(np.float64)
        back = rotate_planar(out, -angle)
        back[..., :2] += middle
        return back

    def _standard(self, values: Array, name: str) -> Array:
        mean, deviation = self._statistics[f"{name}_mean"], self._statistics[f"{name}_std"]
        return np.asarray((values - mean) / deviation, dtype=np.float32)

    def _extra(self, steps: int, seed: int) -> Array | None:
        """What is added to the future context (steps, 256): frames left, and a variation that fades."""
        if not (self.config.arrival and self.config.future):
            return None
        left = steps - np.arange(steps)
        out = arrival_embedding(left, self.config.context)
        if seed:
            drawn = np.random.default_rng(seed).normal(0, VARIED, self.config.context).astype(np.float32)
            out = out + openness(left)[:, None] * drawn
        return out


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
