"""States to the controller's input and output vectors and back; ``layout`` names every slice of them.

Poses and ways are told as they are, so that who is off comes back; of goals what changes is told, mostly
nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.conventions import DT
from nsm_core.model.features.codec import from_root, to_root, turn_in, turn_out, unit
from nsm_core.model.features.rollout_step import restore_bone_lengths
from nsm_core.model.features.state import FUTURE, PIVOT
from nsm_core.rotations import Array, heading_to_direction, matrix_from_forward_up, wrap_angle

from .layout import INPUT, OUTPUT
from .phase import control_of, controlled, phase_of, wave_of
from .state import Goals, HandlingState

_GOALS = ("goal_root", "goal_joints")  # told as changes
NEAR = 1.5  # metres from its goal from which on what is seen from there has a say
ALPHA, BETA = 1.0, 1.0  # weights of radians and of metres in equation 22


def build_inputs(state: HandlingState, goals: Goals) -> Array:
    """Network input (B, INPUT.size) in physical units, all in the frame of the root."""
    root = state.root
    return INPUT.pack(
        joint_position=to_root(state.joint_position, root),
        joint_forward=turn_in(state.joint_forward, root),
        joint_up=turn_in(state.joint_up, root),
        joint_velocity=turn_in(state.joint_velocity, root),
        root=_planar(state.root_keys(), root),
        joints=_solid(state.joint_keys(), root),
        label=goals.present,
        goal_root=_planar(goals.root, root),
        goal_joints=_solid(goals.joints, root),
        goal_label=goals.label,
        wave=wave_of(state.phase),
        frequency=state.phase[:, 2],
        goal_wave=wave_of(goals.phase),
        goal_frequency=goals.phase[:, 2],
    )


def build_targets(
    state: HandlingState, goals: Goals, following: HandlingState, coming: Goals, contact: Array
) -> Array:
    """Output (B, OUTPUT.size) that leads from ``state`` to ``following`` one frame later, whose goals are
    ``coming``; ``contact`` (B, 2) is that of the feet then.
    """
    root, ahead = state.root, following.root_keys()[:, PIVOT:]
    joints = following.joint_keys()[:, PIVOT:]
    made = OUTPUT.pack(
        joint_position=to_root(following.joint_position, root),
        joint_forward=turn_in(following.joint_forward, root),
        joint_up=turn_in(following.joint_up, root),
        joint_velocity=turn_in(following.joint_velocity, root),
        root=_planar(ahead, root),
        joints=_solid(joints, root),
        goalward_root=_planar_from(ahead, goals.root[:, PIVOT:]),
        goalward_joints=_solid_from(joints, goals.joints[:, PIVOT:]),
        goal_root=_planar(coming.root, root),
        goal_joints=_solid(coming.joints, root),
        goal_wave=wave_of(coming.phase),
        goal_frequency=coming.phase[:, 2],
        control=control_of(state.phase, following.phase),
        contact=contact,
    )
    return made - carried(state, goals)


def carried(state: HandlingState, goals: Goals) -> Array:
    """What outputs (B, OUTPUT.size) are the change from: goals as they are, and nothing of all else."""
    return OUTPUT.pack(
        **{name: _zeros(state, name) for name in OUTPUT.shapes if name not in _GOALS},
        goal_root=_planar(goals.root, state.root),
        goal_joints=_solid(goals.joints, state.root),
    )


def _zeros(state: HandlingState, name: str) -> Array:
    return np.zeros((len(state), OUTPUT.width(name)), np.float32)


@dataclass
class Predicted:
    """What the network says of the next frame; shapes as in the state.  ``deviation`` (B,) is equation 22's,
    ``goal_phase`` (B, 3, 8) the network's own estimate.
    """

    state: HandlingState
    goal_phase: Array
    deviation: Array
    contact: Array


def advance(output: Array, state: HandlingState, goals: Goals) -> Predicted:
    """The state one frame later, of an output (B, OUTPUT.size) in physical units (equations 14, 15 and 22).

    The new root is the pivot of the ego-centric way; keys ahead are blended with the goal-centric way, the
    more the nearer a joint is to its goal, and the later the key is.
    """
    told = output + carried(state, goals)
    root = state.root

    def get(name: str) -> Array:
        return OUTPUT.get(told, name)

    velocity = turn_out(get("joint_velocity"), root)
    position = from_root(get("joint_position"), root)
    position = 0.5 * (state.joint_position + DT * velocity) + 0.5 * position
    roots, joints = _from_planar(get("root"), root), _from_solid(get("joints"), root)
    goal_root, goal_joints = goals.root[:, PIVOT:], goals.joints[:, PIVOT:]
    other_roots = _planar_out(get("goalward_root"), goal_root)
    other_joints = _solid_out(get("goalward_joints"), goal_joints)
    deviation = _deviation(roots, other_roots, joints, other_joints)
    late = (np.arange(1, FUTURE + 1) / FUTURE)[None]
    near = np.clip(1 - np.linalg.norm(root[:, None, :2] - goal_root[:, 1:, :2], axis=-1) / NEAR, 0, 1)
    weight = (late * near)[..., None]
    ahead = roots[:, 1:].copy()
    ahead[..., :2] += weight * (other_roots[:, 1:, :2] - ahead[..., :2])
    ahead[..., 2] += weight[..., 0] * wrap_angle(other_roots[:, 1:, 2] - ahead[..., 2])
    away = np.linalg.norm(state.joints[:, None, :, :3] - goal_joints[:, 1:, :, :3], axis=-1)
    weight = (late[..., None] * np.clip(1 - away / NEAR, 0, 1))[..., None]
    joints_ahead = joints[:, 1:] + weight * (other_joints[:, 1:] - joints[:, 1:])
    position = restore_bone_lengths(position.astype(np.float32))
    following = HandlingState(
        position,
        turn_out(unit(get("joint_forward")), root),
        turn_out(unit(get("joint_up")), root),
        velocity,
        np.concatenate((state.root_past[:, 1:], roots[:, :1]), axis=1),
        np.concatenate((state.joints_past[:, 1:], _unit_axes(joints[:, :1])), axis=1),
        ahead,
        _unit_axes(joints_ahead),
        controlled(state.phase, get("control")),
    )
    goal_phase = phase_of(get("goal_wave"), get("goal_frequency"))
    return Predicted(following, goal_phase, deviation, np.clip(get("contact"), 0, 1))


def _deviation(roots: Array, other_roots: Array, joints: Array, other: Array) -> Array:
    """Equation 22 (B,): radians and metres between both views of the key joints, mean over their keys."""
    turn = np.sqrt(2.0) * np.abs(wrap_angle(roots[..., 2] - other_roots[..., 2]))
    cost = ALPHA * turn + BETA * np.linalg.norm(roots[..., :2] - other_roots[..., :2], axis=-1)
    ours, theirs = (matrix_from_forward_up(j[..., 3:6], j[..., 6:9]) for j in (joints, other))
    cosine = (np.einsum("...ij,...ij->...", ours, theirs) - 1) / 2
    angle = np.sqrt(2.0) * np.arccos(np.clip(cosine, -1, 1))
    away = np.linalg.norm(joints[..., :3] - other[..., :3], axis=-1)
    return cost.mean(1) + (ALPHA * angle + BETA * away).sum(-1).mean(1)


def _unit_axes(joints: Array) -> Array:
    return np.concatenate((joints[..., :3], unit(joints[..., 3:6]), unit(joints[..., 6:9])), axis=-1)


def _planar(roots: Array, frame: Array) -> Array:
    """Roots (B, N, 3) seen from a frame (B, 3): place and direction (B, N, 4)."""
    direction = turn_in(heading_to_direction(roots[..., 2]), frame)
    return np.concatenate((to_root(roots[..., :2], frame), direction), axis=-1)


def _from_planar(told: Array, frame: Array) -> Array:
    heading = frame[:, None, 2] + np.arctan2(told[..., 2], -told[..., 3])
    return np.concatenate((from_root(told[..., :2], frame), heading[..., None]), axis=-1)


def _planar_from(roots: Array, frames: Array) -> Array:
    """Roots (B, N, 3), each seen from its own frame (B, N, 3)."""
    shape = (*roots.shape[:2], 4)
    return _planar(roots.reshape(-1, 1, 3), frames.reshape(-1, 3)).reshape(shape)


def _planar_out(told: Array, frames: Array) -> Array:
    shape = (*told.shape[:2], 3)
    return _from_planar(told.reshape(-1, 1, 4), frames.reshape(-1, 3)).reshape(shape)


def _solid(joints: Array, frame: Array) -> Array:
    """Key joints (B, N, 3, 9) seen from a root (B, 3)."""
    batch, keys, count, _ = joints.shape
    flat = joints.reshape(batch, keys * count, 9)
    parts = [to_root(flat[..., :3], frame), turn_in(flat[..., 3:6], frame), turn_in(flat[..., 6:9], frame)]
    return np.concatenate(parts, axis=-1).reshape(joints.shape)


def _from_solid(told: Array, frame: Array) -> Array:
    batch, keys, count, _ = told.shape
    flat = told.reshape(batch, keys * count, 9)
    parts = [
        from_root(flat[..., :3], frame),
        turn_out(flat[..., 3:6], frame),
        turn_out(flat[..., 6:9], frame),
    ]
    return np.concatenate(parts, axis=-1).reshape(told.shape)


def _solid_from(joints: Array, frames: Array) -> Array:
    """Key joints (B, N, 3, 9), each seen from the frame (B, N, 3, 9) of its own goal."""
    axes = matrix_from_forward_up(frames[..., 3:6], frames[..., 6:9])
    seen = [joints[..., :3] - frames[..., :3], joints[..., 3:6], joints[..., 6:9]]
    return np.concatenate([np.einsum("...ji,...j->...i", axes, v) for v in seen], axis=-1)


def _solid_out(told: Array, frames: Array) -> Array:
    axes = matrix_from_forward_up(frames[..., 3:6], frames[..., 6:9])
    place, ahead, up = (np.einsum("...ij,...j->...i", axes, told[..., k : k + 3]) for k in (0, 3, 6))
    return np.concatenate((place + frames[..., :3], ahead, up), axis=-1)


__all__ = ["Predicted", "advance", "build_inputs", "build_targets", "carried"]
