"""Transition networks stepped in numpy alone; as their torch module."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.body.skeleton import HIPS
from nsm_core.model.transitions.layout import PAST, POSE
from nsm_core.model.transitions.representation import poses_of, targets_of, world_joints
from nsm_core.rotations import Array

from .gap_config import arrival_embedding, openness
from .layers_numpy import sigmoid
from .protocol import Weights
from .rtn_config import TransitionConfig

State = tuple[Array, Array]  # output and cell of the recurrent layer, (B, hidden) each
_SLOPE = 0.01


class NumpyTransition:
    """A network of sizes and the weights that fit them; all vectors are standardised, rows are gaps."""

    def __init__(self, config: TransitionConfig, weights: Weights) -> None:
        self.config, self._p = config, weights.parameters
        self.statistics = weights.statistics

    def begin(self, first: Array) -> State:
        """As ``TransitionNetwork.begin``."""
        if self.config.initial == "first_frame":
            state = self._dense("initial.1", _leaky(self._dense("initial.0", first)))
        elif self.config.initial == "common":
            state = np.broadcast_to(self._p["common"], (len(first), 2 * self.config.hidden))
        else:
            state = np.zeros((len(first), 2 * self.config.hidden), np.float32)
        output, cell = np.split(state, 2, axis=-1)
        return output, cell

    def encoded_target(self, target: Array) -> Array | None:
        """As ``TransitionNetwork.encoded_target``."""
        return self._through("target", target) if self.config.future else None

    def step(
        self,
        pose: Array,
        patch: Array | None,
        target: Array | None,
        offset: Array,
        extra: Array | None,
        state: State,
        base: Array,
    ) -> tuple[Array, State]:
        """Predict the next poses (B, 69) of poses (B, 69), patches (B, 169), encoded targets (B, 128),
        offsets (B, 69) and what is added to the future context (B, 256); and the state for the next step.
        A residual network adds to ``base`` (B, 69): the poses themselves, or the next ones on the way home.
        """
        x = pose if patch is None else np.concatenate((pose, patch), axis=-1)
        gates = self._dense("feed", self._through("encode", x) if self.config.encoder else x)
        if target is not None:
            context = np.concatenate((target, self._through("offset", offset)), axis=-1)
            if extra is not None:
                context = context + extra
            gates = gates + context @ self._p["condition.weight"].T
        output, cell = state
        gates = gates + output @ self._p["recur.weight"].T
        come, stay, new, tell = np.split(gates, 4, axis=-1)
        cell = sigmoid(stay) * cell + sigmoid(come) * np.tanh(new)
        output = sigmoid(tell) * np.tanh(cell)
        last = 2 if self.config.decoder else 0
        y = output
        for n in range(last):
            y = _leaky(self._dense(f"decode.{n}", y))
        y = self._dense(f"decode.{last}", y)
        return (base + y if self.config.residual else y), (output, cell)

    def fill(
        self, joints: Array, frames: int, patches: Callable[[Array], Array] | None, noise: Array | None
    ) -> Array:
        """World joints (frames + 1, 69), metres, of the missing frames and the target's, of past, target and
        the frame behind it (PAST + 2, 23, 3), as ``roll_out`` tells them; ``patches`` gives those (T, 169),
        metres, around hips (T, 3), ``noise`` (context,) is a variation.
        """
        size, mean, deviation = POSE.size, self.statistics["pose_mean"], self.statistics["pose_std"]
        truth = self._standard(poses_of(joints[:PAST]), "pose")
        goal, wanted = joints[PAST].reshape(1, -1), targets_of(joints[PAST:])[None]
        wanted = np.concatenate(
            (self._standard(wanted[:, :size], "pose"), self._standard(wanted[:, size:], "velocity")), axis=1
        )
        encoded = self.encoded_target(wanted)
        steps = PAST + frames
        extra = self._extra(steps, noise)
        state = self.begin(truth[:1])
        pose, world, told = truth[:1], joints[:1].reshape(1, -1), []
        for t in range(1, steps + 1):
            root = world[:, 3 * HIPS : 3 * HIPS + 3]
            base = pose
            if self.config.homing:
                share = np.float32(1 / (steps - t + 1))
                way = (goal[:, 3 * HIPS : 3 * HIPS + 3] - root) * share
                way = (way - mean[:3]) / deviation[:3]
                base = np.concatenate((way, pose[:, 3:] + share * (wanted[:, 3:size] - pose[:, 3:])), axis=1)
            patch = None if patches is None else self._standard(patches(root), "patch")
            offset = self._standard(goal - world, "offset")
            more = None if extra is None else extra[t - 1 : t]
            pose, state = self.step(pose, patch, encoded, offset, more, state, base)
            if t < PAST:  # what is known is not told again
                pose, world = truth[t : t + 1], joints[t].reshape(1, -1)
                continue
            physical = pose * deviation + mean
            world = world_joints(physical, root + physical[:, :3])
            told.append(world[0])
        return np.stack(told)

    def _extra(self, steps: int, noise: Array | None) -> Array | None:
        """What is added to the future context (steps, 256): frames left, and a variation that fades."""
        if not self.config.varied:
            return None
        left = steps - np.arange(steps)
        out = arrival_embedding(left, self.config.context)
        return out if noise is None else out + openness(left)[:, None] * noise

    def _standard(self, values: Array, name: str) -> Array:
        mean, deviation = self.statistics[f"{name}_mean"], self.statistics[f"{name}_std"]
        return np.asarray((values - mean) / deviation, dtype=np.float32)

    def _dense(self, name: str, x: Array) -> Array:
        return np.asarray(x @ self._p[f"{name}.weight"].T + self._p[f"{name}.bias"])

    def _through(self, name: str, x: Array) -> Array:
        return _leaky(self._dense(f"{name}.1", _leaky(self._dense(f"{name}.0", x))))


def _leaky(x: Array) -> Array:
    return np.where(x > 0, x, np.float32(_SLOPE) * x)


__all__ = ["NumpyTransition", "State"]
