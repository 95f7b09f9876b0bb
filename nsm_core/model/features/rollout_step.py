"""Move a batch of characters on by one frame from the network's output: section 4.2 and the reference's order
of work.

The same function advances the roll-outs of training and the takes in Blender.  It changes neither goals nor
sensors: those are the control's business before the next prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.skeleton import LEVELS, OFFSETS
from nsm_core.conventions import DT
from nsm_core.rotations import Array, wrap_angle

from .codec import Prediction, integrate_position
from .state import FUTURE, State

_LENGTHS = np.linalg.norm(OFFSETS, axis=1)


@dataclass(frozen=True)
class Blending:
    """Switches of the bi-directional scheme, for ablations."""

    goal_centric: bool = True  # trajectory seen from the goal (section 4.2, first part)
    future_pose: bool = True  # velocities led by the pose seen from one second ahead (second part)


BLENDINGS = {
    "both": Blending(),
    "trajectory": Blending(future_pose=False),
    "pose": Blending(goal_centric=False),
    "none": Blending(False, False),
}


def goal_centric_weights(distance: Array) -> Array:
    """Weights (B, 6) of the goal-centric keys at ``distance`` (B, 6), metres, from their goals.

    w^(d^2) with w growing linearly towards the last key: near the goal its view wins, far away it has no say.
    """
    w = np.arange(1, FUTURE + 1, dtype=np.float32) / (FUTURE + 1)
    return w ** np.square(distance)


def restore_bone_lengths(positions: Array) -> Array:
    """Give bones the skeleton's lengths, parents first: each joint of (B, J, 3) keeps its direction from its
    parent's new place.
    """
    restored = positions.copy()
    for joints, parents in LEVELS:
        above = restored[:, parents]
        bone = restored[:, joints] - above
        length = np.maximum(np.linalg.norm(bone, axis=-1, keepdims=True), 1e-6)
        restored[:, joints] = above + bone * (_LENGTHS[joints, None] / length)
    return restored


def advance(state: State, predicted: Prediction, blending: Blending = Blending()) -> State:
    """Return the state one frame later; goals are carried over unchanged.

    The new root is the predicted pivot key.  The keys ahead are blended between the ego-centric and the
    goal-centric prediction; the pivot never is.
    """
    positions = restore_bone_lengths(integrate_position(state, predicted))
    velocity = predicted.joint_velocity
    if blending.future_pose:
        # (1 - lambda) v + lambda (R' j~ - j) with lambda = dt; the difference is per frame, so it counts 1 /
        # dt.
        velocity = (1 - DT) * velocity + (predicted.future_joint_position - state.joint_position)
    future = predicted.root[:, 1:].copy()
    if blending.goal_centric:
        distance = np.linalg.norm(future[..., :2] - state.goal_position[:, -FUTURE:, :2], axis=-1)
        weight = goal_centric_weights(distance)[..., None]
        other = predicted.root_goalward[:, 1:]
        future[..., :2] += weight * (other[..., :2] - future[..., :2])
        future[..., 2] += weight[..., 0] * wrap_angle(other[..., 2] - future[..., 2])
    phase = (state.phase_past[:, -1:] + predicted.phase_update) % 1.0

    def shift(past: Array, new: Array) -> Array:
        return np.concatenate((past[:, 1:], new[:, None].astype(np.float32)), axis=1)

    return State(
        positions.astype(np.float32),
        predicted.joint_forward.astype(np.float32),
        predicted.joint_up.astype(np.float32),
        velocity.astype(np.float32),
        shift(state.root_past, predicted.root[:, 0]),
        shift(state.style_past, predicted.style[:, 0]),
        shift(state.phase_past, phase[:, 0]),
        future.astype(np.float32),
        predicted.style[:, 1:].astype(np.float32),
        phase[:, 1:].astype(np.float32),
        state.goal_position,
        state.goal_heading,
        state.goal_action,
    )
