"""Two-bone inverse kinematics in closed form: legs and arms put their ends where they are told.

Everything is vectorised over leading axes, so a frame and a whole take cost the same number of calls.
A limb keeps the plane it is bent in; a nearly straight one bends as the joint does (knees forward), and never backward.
"""

from __future__ import annotations

import numpy as np

from .rotations import Array, quat_conjugate, quat_from_matrix, quat_mul, quat_rotate, quat_to_matrix
from .skeleton import ARMS, FEET, INDEX, OFFSETS, PARENTS

# Hinge axis of knee and elbow in the rest frame of the upper bone: turning the lower bone about it flexes the joint.
_HINGES = {INDEX["RightKnee"]: (1, 0, 0), INDEX["LeftKnee"]: (1, 0, 0), INDEX["RightElbow"]: (0, 0, 1), INDEX["LeftElbow"]: (0, 0, -1)}
# Of the length of the straight limb: where the reach begins to soften, its end, and the tightest fold.
SOFT_REACH, FULL_REACH, TIGHTEST = 0.99, 0.9995, 0.25
# Sine of the bend over which the limb's own plane takes over from the hinge axis.
_STRAIGHT, _BENT = 0.02, 0.12


def solve_two_bone(hip: Array, knee: Array, ankle: Array, target: Array, hinge: Array) -> tuple[Array, Array, Array]:
    """Bend a limb so that its end meets a target.

    Args:
        hip, knee, ankle: (..., 3) joints of the limb, any frame, metres.
        target: (..., 3) where the end shall be; what is out of reach is approached softly, without a pop at full length.
        hinge: (..., 3) axis about which the limb flexes by the right-hand rule (a person's right for knees),
            used when the limb is nearly straight or bent the wrong way.

    Returns:
        The new knee and ankle, (..., 3), and the axis (..., 3) about which the limb is now bent.
    """
    knee, ankle, axis = _solve(hip, knee, ankle, target, hinge)[:3]
    return knee, ankle, axis


def place_limb(
    hips_position: Array, local_rotations: Array, chain: tuple[int, int, int], target: Array, end_rotation: Array | None = None
) -> Array:
    """Put the end of a limb at a target by turning its two bones; return new (..., 23, 4) local rotations.

    Args:
        hips_position: (..., 3) world, metres.
        local_rotations: (..., 23, 4) parent-relative.
        chain: joints of the limb's start, middle and end, such as ``skeleton.ARMS[0]`` or ``skeleton.FEET[0][:3]``.
        target: (..., 3) world position for the end joint.
        end_rotation: (..., 4) world rotation for the end joint; None keeps the world rotation it had.

    All other joints keep their local rotations.  Unreachable targets are approached as in ``solve_two_bone``.
    """
    return place_limbs(hips_position, local_rotations, (chain,), target[..., None, :], None if end_rotation is None else end_rotation[..., None, :])


def place_limbs(
    hips_position: Array, local_rotations: Array, chains: tuple[tuple[int, int, int], ...], targets: Array, end_rotations: Array | None = None
) -> Array:
    """Put the ends of several limbs at targets at once; as ``place_limb`` with (..., L, 3) targets and (..., L, 4) rotations.

    The limbs must not hang on one another.
    """
    dtype = local_rotations.dtype
    local = local_rotations.astype(np.float64)
    starts, middles, ends = (list(joints) for joints in zip(*chains, strict=True))
    position, parent = chain_frames(hips_position, local, tuple(starts))
    upper = quat_mul(parent, local[..., starts, :])
    lower = quat_mul(upper, local[..., middles, :])
    if end_rotations is None:
        end_rotations = quat_mul(lower, local[..., ends, :])
    rotation = np.stack((quat_to_matrix(upper), quat_to_matrix(lower)))
    bones = (rotation @ np.stack((OFFSETS[middles], OFFSETS[ends])).reshape((2,) + (1,) * (local.ndim - 2) + (len(starts), 3, 1)))[..., 0]
    knee = position + bones[0]
    ankle = knee + bones[1]
    hinge = (rotation[0] @ np.array([_HINGES[m] for m in middles], dtype=np.float64)[:, :, None])[..., 0]
    new_knee, new_ankle, axis, old_axis = _solve(position, knee, ankle, np.asarray(targets, dtype=np.float64), hinge)
    # Each bone turns by what carries its direction and the bending axis from before to after.
    after = _frame(np.stack((new_knee - position, new_ankle - new_knee)), axis)
    turn = quat_from_matrix(after @ np.swapaxes(_frame(bones, old_axis), -1, -2))
    new_upper, new_lower = quat_mul(turn[0], upper), quat_mul(turn[1], lower)
    local[..., starts, :] = quat_mul(quat_conjugate(parent), new_upper)
    local[..., middles, :] = quat_mul(quat_conjugate(new_upper), new_lower)
    local[..., ends, :] = quat_mul(quat_conjugate(new_lower), end_rotations)
    return local.astype(dtype)


def place_ankles(hips_position: Array, local_rotations: Array, side: int, ankle_target: Array, ankle_rotation: Array | None = None) -> Array:
    """Put the ankle of one leg at a target; return new (..., 23, 4) local rotations.

    ``side`` is 0 for right and 1 for left; ``ankle_target`` (..., 3) world metres; ``ankle_rotation`` (..., 4) world,
    None keeps the foot as it stood in the world.  The knee bends only forward and never over-stretches.
    """
    return place_limb(hips_position, local_rotations, FEET[side][:3], ankle_target, ankle_rotation)


def place_wrists(hips_position: Array, local_rotations: Array, side: int, wrist_target: Array, wrist_rotation: Array | None = None) -> Array:
    """Put the wrist of one arm at a target; as ``place_ankles``."""
    return place_limb(hips_position, local_rotations, ARMS[side], wrist_target, wrist_rotation)


def solve_leg_with_toe(hips_position: Array, local_rotations: Array, side: int, toe_target: Array, foot_rotation: Array) -> Array:
    """Put the toe joint of one leg at (..., 3) world metres with the foot turned to (..., 4) world; return new local rotations."""
    offset = np.broadcast_to(OFFSETS[FEET[side][3]].astype(foot_rotation.dtype), foot_rotation.shape[:-1] + (3,))
    return place_limb(hips_position, local_rotations, FEET[side][:3], toe_target - quat_rotate(foot_rotation, offset), foot_rotation)


def chain_frames(hips_position: Array, local_rotations: Array, joints: tuple[int, ...]) -> tuple[Array, Array]:
    """World position (..., L, 3) of ``joints`` and world rotation (..., L, 4) of their parents, walking only their ancestors."""
    known = {0: (np.asarray(hips_position, dtype=local_rotations.dtype), local_rotations[..., 0, :])}

    def frame(j: int) -> tuple[Array, Array]:
        if j not in known:
            p, r = frame(PARENTS[j])
            offset = np.broadcast_to(OFFSETS[j].astype(r.dtype), p.shape)
            known[j] = (p + quat_rotate(r, offset), quat_mul(r, local_rotations[..., j, :]))
        return known[j]

    parents = [frame(PARENTS[j]) for j in joints]
    rotation = np.stack([r for _, r in parents], axis=-2)
    offsets = np.broadcast_to(OFFSETS[list(joints)].astype(rotation.dtype), rotation.shape[:-1] + (3,))
    return np.stack([p for p, _ in parents], axis=-2) + quat_rotate(rotation, offsets), rotation


def leg_reach() -> float:
    """Length of a leg, hip joint to ankle, that is reached without softening, metres."""
    return SOFT_REACH * float(np.linalg.norm(OFFSETS[list(FEET[0][1:3])], axis=-1).sum())


def _solve(hip: Array, knee: Array, ankle: Array, target: Array, hinge: Array) -> tuple[Array, Array, Array, Array]:
    """``solve_two_bone`` that also returns the axis about which the limb was bent before."""
    upper, lower = knee - hip, ankle - knee
    a, b = _length(upper), _length(lower)
    before, before_length = _unit(ankle - hip)
    way, distance = _unit(target - hip)
    way = np.where(distance > 1e-6, way, before)
    distance = _soften(distance, before_length, a + b)

    # The plane of the bend: the limb's own where it is clearly bent, else the joint's hinge.
    bend = _cross(upper, lower) / (a * b)
    hinge = _unit(hinge - before * _dot(hinge, before))[0]
    sine = _length(bend)
    own = np.clip((sine - _STRAIGHT) / (_BENT - _STRAIGHT), 0, 1)
    own = np.where(_dot(bend, hinge) > 0, own * own * (3 - 2 * own), 0)
    old_axis = _unit(own * bend / np.maximum(sine, 1e-9) + (1 - own) * hinge)[0]
    # Swing that plane along with the line from start to end.
    w, c = _cross(before, way), _dot(before, way)
    wn = _cross(w, old_axis)
    axis = old_axis + wn + _cross(w, wn) / np.maximum(1 + c, 1e-6)
    axis = _unit(axis - way * _dot(axis, way))[0]

    cosine = np.clip((a * a + distance * distance - b * b) / (2 * a * distance), -1, 1)
    new_knee = hip + a * (cosine * way + np.sqrt(1 - cosine * cosine) * _cross(way, axis))
    return new_knee, hip + distance * way, axis, old_axis


def _soften(distance: Array, before: Array, length: Array) -> Array:
    """Clamp the distance a limb spans: soft near full length, but never shorter than it already was for the same target."""
    start = np.maximum(SOFT_REACH * length, np.minimum(before, (FULL_REACH - 1e-4) * length))
    room = FULL_REACH * length - start
    over = np.maximum(distance - start, 0)
    return np.maximum(np.where(over > 0, start + room * -np.expm1(-over / room), distance), TIGHTEST * length)


def _frame(direction: Array, axis: Array) -> Array:
    """Right-handed frames (..., 3, 3) with their first column along ``direction`` and the second near ``axis``."""
    x = _unit(direction)[0]
    y = _unit(axis - x * _dot(axis, x))[0]
    return np.stack((x, y, _cross(x, y)), axis=-1)


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(-1, keepdims=True)


def _length(v: Array) -> Array:
    return np.sqrt((v * v).sum(-1, keepdims=True))


def _unit(v: Array) -> tuple[Array, Array]:
    n = _length(v)
    return v / np.maximum(n, 1e-9), n


def _cross(a: Array, b: Array) -> Array:
    # np.cross moves axes about and is several times slower on single frames.
    return a[..., (1, 2, 0)] * b[..., (2, 0, 1)] - a[..., (2, 0, 1)] * b[..., (1, 2, 0)]
