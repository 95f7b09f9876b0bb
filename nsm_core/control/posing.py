"""Between the network's state and poses: joints as rotations, and the standing state that a take
begins with.
"""

from __future__ import annotations

import math

import numpy as np

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ARMS, FEET, HIPS, OFFSETS, J, forward_kinematics, local_from_world
from nsm_core.components import cross, dot, turned
from nsm_core.errors import GoalError
from nsm_core.model.features.state import State, standing_state
from nsm_core.model.inference.model import Model
from nsm_core.rotations import (
    Array,
    heading_quat,
    matrix_from_forward_up,
    quat_from_matrix,
    quat_from_rotvec,
    quat_mul,
    quat_to_matrix,
)

_LEGS = tuple(leg[:3] for leg in FEET)
_ELBOWS = tuple(
    (elbow, np.array((0.0, 0.0, sign))) for (_, elbow, _), sign in zip(ARMS, (1, -1), strict=True)
)  # and their hinges
_ARM_BONES = tuple((OFFSETS[elbow].tolist(), OFFSETS[wrist].tolist()) for _, elbow, wrist in ARMS)


def pose_of(state: State) -> tuple[Array, Array]:
    """Hips position (3,) and local rotations (23, 4) of one character's state.

    Rotations come from the predicted axes; the legs are then solved so that the ankles are where the network
    put them, since its positions carry the contact with the floor and a chain of rotations does not.
    """
    matrices = matrix_from_forward_up(state.joint_forward[0], state.joint_up[0])
    world = quat_from_matrix(matrices.astype(np.float64))
    local = local_from_world(world)
    hips = state.joint_position[0, HIPS].astype(np.float64)
    ankles = state.joint_position[0, [leg[2] for leg in FEET]].astype(np.float64)
    feet = world[[leg[2] for leg in FEET]]
    local = unbend_elbows(local)
    return hips.astype(np.float32), place_limbs(hips, local, _LEGS, ankles, feet).astype(np.float32)


def unbend_elbows(local: Array) -> Array:
    """Straighten elbows of local rotations (23, 4) that bend backward, as noisy captures teach now and then;
    returns new ones.
    """
    local = local.copy()
    for (elbow, hinge), (upper, bone) in zip(_ELBOWS, _ARM_BONES, strict=True):
        lower = turned(local[elbow].tolist(), bone)
        flexion = math.atan2(hinge[2] * cross(upper, lower)[2], dot(upper, lower))
        if flexion < 0:
            local[elbow] = quat_mul(quat_from_rotvec(-flexion * hinge), local[elbow])
    return local


def stance_of(model: Model) -> tuple[float, Array]:
    """Height of the hips, metres, and local rotations (23, 4) of the stance that comes with the weights,
    facing -Y.
    """
    stance = model.metadata.get("stance")
    if stance is None:
        raise GoalError("The weights carry no standing pose; train them again with this version.")
    return float(stance["hips_height"]), np.array(stance["local_rotations"], dtype=np.float64).reshape(J, 4)


def standing_start(model: Model, root: Array, rng: np.random.Generator) -> State:
    """A standing state at ``root`` (3,) from the stance that comes with the weights."""
    height, local = stance_of(model)
    local[0] = quat_mul(heading_quat(np.array(float(root[2]))), local[0])
    hips = np.array([root[0], root[1], height], dtype=np.float64)
    positions, world = forward_kinematics(hips, local)
    matrices = quat_to_matrix(world)
    state = standing_state(positions[None], -matrices[None, ..., 1], matrices[None, ..., 2], root[None])
    shift = float(rng.random())
    state.phase_past, state.phase_future = (
        (state.phase_past + shift) % 1.0,
        (state.phase_future + shift) % 1.0,
    )
    return state
