"""States to the network's input, gating and output vectors and back; ``layout`` names every slice of them.

The data set, the roll-outs of training and the stepper all build and read vectors here.  The layout follows
the paper where it is complete (sensor sizes, planar goal directions) and the published code where the paper
is silent or the code is later (seven future keys with the pivot, a phase and a phase update for every key).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.conventions import DT
from nsm_core.rotations import Array, heading_to_direction, rotate_planar, wrap_angle

from .layout import CELLS, FRAME, GATING, GOAL, INPUT, INTERACTION, OUTPUT, Inputs
from .state import PIVOT, State


@dataclass
class SensorReading:
    """What the sensors tell a batch of characters (section 4.3).

    ``environment`` (B, 1408) occupancies at the current root; ``cells`` (B, 512, 3) interaction cell centres,
    world metres; ``occupancy`` (B, 512).  Without an object the cells lie at the root and are empty.
    """

    environment: Array
    cells: Array
    occupancy: Array


def no_object(root: Array) -> tuple[Array, Array]:
    """Interaction cells (B, 512, 3) and occupancy (B, 512) of characters at ``root`` (B, 3) without an
    object.
    """
    cells = np.zeros((len(root), CELLS, 3), dtype=np.float32)
    cells[..., :2] = root[:, None, :2]
    return cells, np.zeros((len(root), CELLS), dtype=np.float32)


def to_root(points: Array, root: Array) -> Array:
    """World points (B, N, 2 or 3) in the frame of roots (B, 3)."""
    moved = points.copy()
    moved[..., :2] -= root[:, None, :2]
    return rotate_planar(moved, -root[:, None, 2])


def from_root(points: Array, root: Array) -> Array:
    """Back from ``to_root``."""
    moved = rotate_planar(points, root[:, None, 2])
    moved[..., :2] += root[:, None, :2]
    return moved


def turn_in(vectors: Array, root: Array) -> Array:
    """World directions (B, N, 2 or 3) in the frame of roots (B, 3)."""
    return rotate_planar(vectors, -root[:, None, 2])


def turn_out(vectors: Array, root: Array) -> Array:
    """Back from ``turn_in``."""
    return rotate_planar(vectors, root[:, None, 2])


def unit(v: Array) -> Array:
    """Vectors (..., k) of length one."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-6)


def build_gating(state: State) -> Array:
    """Gating features (B, 650): per key, its labels, goal action, goal distance and angle, times its phase
    vector.

    Equations 5 to 7.  As in the published code each key has its own phase, inactive labels are -1, the
    distance is in metres; the angle is in radians here, so that its scale is that of the others.
    """
    roots = state.root_keys()
    phase = 2 * np.pi * state.phase_keys()
    wave = np.stack((np.sin(phase), np.cos(phase)), axis=-1)  # (B, 13, 2)
    styles, actions = 2 * state.style_keys() - 1, 2 * state.goal_action - 1
    distance = np.linalg.norm(roots[..., :2] - state.goal_position[..., :2], axis=-1)
    angle = np.abs(wrap_angle(roots[..., 2] - state.goal_heading))
    scaled = np.stack((np.ones_like(distance), distance, angle), axis=-1)
    features = np.concatenate(
        (styles, (actions[..., None] * scaled[:, :, None]).reshape(*actions.shape[:2], -1)), axis=-1
    )
    return GATING.pack(per_key=features[..., None] * wave[:, :, None])


def build_inputs(state: State, around: SensorReading) -> Inputs[Array]:
    """Network input (B, 4018) and gating input (B, 650) of a state (section 3.1, Inputs), physical units."""
    root, keys = state.root, state.root_keys()
    frame = FRAME.pack(
        joint_position=to_root(state.joint_position, root),
        joint_forward=turn_in(state.joint_forward, root),
        joint_up=turn_in(state.joint_up, root),
        joint_velocity=turn_in(state.joint_velocity, root),
        trajectory_position=to_root(keys[..., :2], root),
        trajectory_direction=turn_in(heading_to_direction(keys[..., 2]), root),
        trajectory_style=state.style_keys(),
    )
    goal = GOAL.pack(
        goal_position=to_root(state.goal_position, root),
        goal_direction=turn_in(heading_to_direction(state.goal_heading), root),
        goal_action=state.goal_action,
    )
    interaction = INTERACTION.pack(cell_position=to_root(around.cells, root), cell_occupancy=around.occupancy)
    features = INPUT.pack(frame=frame, goal=goal, environment=around.environment, interaction=interaction)
    return Inputs(features, build_gating(state))


def build_targets(state: State, following: State, contacts: Array) -> Array:
    """Network output (B, 605) that turns ``state`` into ``following`` one frame later (section 3.1, Outputs).

    Everything is in the root frame of ``state``, but for the goal-centric trajectory, which is in the frame
    of the goal at the pivot, and the future joint positions, which are those of ``following`` seen from the
    root one second ahead of ``state``.  ``contacts`` (B, 5) belong to ``following``.
    """
    root = state.root
    ahead = following.root_keys()[:, PIVOT:]
    goal = np.concatenate((state.goal_position[:, PIVOT, :2], state.goal_heading[:, PIVOT, None]), axis=1)
    direction = heading_to_direction(ahead[..., 2])
    phases = np.concatenate((state.phase_past[:, -1:], following.phase_keys()[:, PIVOT:]), axis=1)
    steps = np.diff(phases, axis=1)
    return OUTPUT.pack(
        joint_position=to_root(following.joint_position, root),
        joint_forward=turn_in(following.joint_forward, root),
        joint_up=turn_in(following.joint_up, root),
        joint_velocity=turn_in(following.joint_velocity, root),
        future_joint_position=to_root(following.joint_position, state.root_future[:, -1]),
        trajectory_position=to_root(ahead[..., :2], root),
        trajectory_direction=turn_in(direction, root),
        trajectory_style=following.style_keys()[:, PIVOT:],
        goalward_position=to_root(ahead[..., :2], goal),
        goalward_direction=turn_in(direction, goal),
        goal_position=to_root(following.goal_position, root),
        goal_direction=turn_in(heading_to_direction(following.goal_heading), root),
        goal_action=following.goal_action,
        contact=contacts,
        phase_update=np.cumsum(steps - np.round(steps), axis=1),
    )


@dataclass
class Prediction:
    """The network's output read back into the world; shapes as in ``State``, trajectories at the pivot and
    six keys.
    """

    joint_position: Array
    joint_forward: Array
    joint_up: Array
    joint_velocity: Array
    future_joint_position: Array
    root: Array  # (B, 7, 3) ego-centric
    root_goalward: Array  # (B, 7, 3) goal-centric
    style: Array
    goal_position: Array
    goal_heading: Array
    goal_action: Array
    contact: Array
    phase_update: Array


def read_outputs(output: Array, state: State) -> Prediction:
    """Turn a network output (B, 605), physical units, back into world quantities for characters at
    ``state``.
    """
    root = state.root
    goal = np.concatenate((state.goal_position[:, PIVOT, :2], state.goal_heading[:, PIVOT, None]), axis=1)

    def get(name: str) -> Array:
        return OUTPUT.get(output, name)

    def planar(position: str, direction: str, frame: Array) -> Array:
        d = get(direction)
        heading = frame[:, None, 2] + np.arctan2(d[..., 0], -d[..., 1])
        return np.concatenate((from_root(get(position), frame), heading[..., None]), axis=-1)

    goals = planar("goal_position", "goal_direction", root)
    return Prediction(
        joint_position=from_root(get("joint_position"), root),
        joint_forward=turn_out(unit(get("joint_forward")), root),
        joint_up=turn_out(unit(get("joint_up")), root),
        joint_velocity=turn_out(get("joint_velocity"), root),
        future_joint_position=from_root(get("future_joint_position"), state.root_future[:, -1]),
        root=planar("trajectory_position", "trajectory_direction", root),
        root_goalward=planar("goalward_position", "goalward_direction", goal),
        style=np.clip(get("trajectory_style"), 0, 1),
        goal_position=goals[..., :3],
        goal_heading=goals[..., 3],
        goal_action=np.clip(get("goal_action"), 0, 1),
        contact=np.clip(get("contact"), 0, 1),
        phase_update=get("phase_update"),
    )


def integrate_position(state: State, predicted: Prediction) -> Array:
    """Half-and-half mix (B, J, 3) of predicted positions and of old positions moved by the predicted
    velocity.
    """
    return 0.5 * (state.joint_position + DT * predicted.joint_velocity) + 0.5 * predicted.joint_position
