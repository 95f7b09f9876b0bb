"""Two-bone inverse kinematics in closed form: legs and arms put their ends where they are told.

Everything is vectorised over leading axes, so a frame and a whole take cost the same number of calls.
A limb keeps the plane it is bent in; a nearly straight one bends as the joint does (knees forward), and never backward.
"""

from __future__ import annotations

import numpy as np

from .rotations import Array, cross, quat_conjugate
from .rotations import quat_mul as mul
from .rotations import quat_rotate as rotate
from .skeleton import ARMS, FEET, INDEX, OFFSETS, PARENTS

# Hinge axis of knee and elbow in the rest frame of the upper bone: turning the lower bone about it flexes the joint.
_HINGES = {INDEX["RightKnee"]: (1, 0, 0), INDEX["LeftKnee"]: (1, 0, 0), INDEX["RightElbow"]: (0, 0, 1), INDEX["LeftElbow"]: (0, 0, -1)}
# Of the length of the straight limb: where the reach begins to soften, its end, and the tightest fold.
SOFT_REACH, FULL_REACH, TIGHTEST = 0.99, 0.9995, 0.15
# The plane of a bend this small is noise (sine of the bend); and of its sine by the new one, where it is not to be magnified.
_STRAIGHT, _BENT = 0.02, 0.12
_MAGNIFIED, _LIKE = 0.3, 0.8


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
    return place_limbs(
        hips_position, local_rotations, (chain,), target[..., None, :], None if end_rotation is None else end_rotation[..., None, :]
    )


def place_limbs(
    hips_position: Array,
    local_rotations: Array,
    chains: tuple[tuple[int, int, int], ...],
    targets: Array,
    end_rotations: Array | None = None,
) -> Array:
    """Put the ends of several limbs at targets at once; as ``place_limb`` with (..., L, 3) targets and (..., L, 4) rotations.

    The limbs must not hang on one another.
    """
    dtype = local_rotations.dtype
    local = local_rotations.astype(np.float64)
    starts, middles, ends = (list(joints) for joints in zip(*chains, strict=True))
    position, parent = chain_frames(hips_position, local, tuple(starts))
    upper = mul(parent, local[..., starts, :])
    lower = mul(upper, local[..., middles, :])
    if end_rotations is None:
        end_rotations = mul(lower, local[..., ends, :])
    hinges = np.array([_HINGES[m] for m in middles], dtype=np.float64)
    rest = np.stack((OFFSETS[middles], OFFSETS[ends], hinges)).reshape((3,) + (1,) * (local.ndim - 2) + (len(starts), 3))
    vectors = rotate(np.stack((upper, lower, upper)), rest)
    bones = vectors[:2]
    knee = position + bones[0]
    new_knee, new_ankle, axis, old_axis = _solve(position, knee, knee + bones[1], np.asarray(targets, dtype=np.float64), vectors[2])
    # Each bone turns by what carries its direction and the bending axis from before to after.
    turn = _carry(bones, old_axis, np.stack((new_knee - position, new_ankle - new_knee)), axis)
    new_upper, new_lower = mul(turn[0], upper), mul(turn[1], lower)
    local[..., starts, :] = mul(quat_conjugate(parent), new_upper)
    local[..., middles, :] = mul(quat_conjugate(new_upper), new_lower)
    local[..., ends, :] = mul(quat_conjugate(new_lower), np.asarray(end_rotations, dtype=np.float64))
    return local.astype(dtype)


def place_ankles(
    hips_position: Array, local_rotations: Array, side: int, ankle_target: Array, ankle_rotation: Array | None = None
) -> Array:
    """Put the ankle of one leg at a target; return new (..., 23, 4) local rotations.

    ``side`` is 0 for right and 1 for left; ``ankle_target`` (..., 3) world metres; ``ankle_rotation`` (..., 4) world,
    None keeps the foot as it stood in the world.  The knee bends only forward and never over-stretches.
    """
    return place_limb(hips_position, local_rotations, FEET[side][:3], ankle_target, ankle_rotation)


def place_wrists(
    hips_position: Array, local_rotations: Array, side: int, wrist_target: Array, wrist_rotation: Array | None = None
) -> Array:
    """Put the wrist of one arm at a target; as ``place_ankles``."""
    return place_limb(hips_position, local_rotations, ARMS[side], wrist_target, wrist_rotation)


def solve_leg_with_toe(hips_position: Array, local_rotations: Array, side: int, toe_target: Array, foot_rotation: Array) -> Array:
    """Put the toe joint of one leg at (..., 3) world metres with the foot turned to (..., 4) world; return new local rotations."""
    ankle_target = toe_target - rotate(foot_rotation, OFFSETS[FEET[side][3]].astype(foot_rotation.dtype))
    return place_limb(hips_position, local_rotations, FEET[side][:3], ankle_target, foot_rotation)


def chain_frames(hips_position: Array, local_rotations: Array, joints: tuple[int, ...]) -> tuple[Array, Array]:
    """World position (..., L, 3) of ``joints`` and world rotation (..., L, 4) of their parents, walking only their ancestors."""
    known = {0: (np.asarray(hips_position, dtype=local_rotations.dtype), local_rotations[..., 0, :])}

    def frame(j: int) -> tuple[Array, Array]:
        if j not in known:
            p, r = frame(PARENTS[j])
            known[j] = (p + rotate(r, OFFSETS[j].astype(r.dtype)), mul(r, local_rotations[..., j, :]))
        return known[j]

    parents = [frame(PARENTS[j]) for j in joints]
    rotation = np.stack([r for _, r in parents], axis=-2)
    return np.stack([p for p, _ in parents], axis=-2) + rotate(rotation, OFFSETS[list(joints)].astype(rotation.dtype)), rotation


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

    # The plane of the bend: the limb's own where it is clearly bent, else the joint's hinge.  A limb that was nearly straight
    # and is to bend much would magnify the noise of its own plane into swings of the knee.
    bend = cross(upper, lower) / (a * b)
    hinge = _unit(hinge - before * _dot(hinge, before))[0]
    sine = _length(bend)
    new_cosine = (distance * distance - a * a - b * b) / (2 * a * b)
    new_sine = np.sqrt(np.maximum(1 - new_cosine * new_cosine, 1e-6))
    own = _ramp(sine, _STRAIGHT, _BENT) * np.maximum(_ramp(sine / new_sine, _MAGNIFIED, _LIKE), _ramp(sine, 0.4, 0.6))
    own = np.where(_dot(bend, hinge) > 0, own, 0)
    old_axis = _unit(own * bend / np.maximum(sine, 1e-9) + (1 - own) * hinge)[0]
    # Swing that plane along with the line from start to end.
    w, c = cross(before, way), _dot(before, way)
    wn = cross(w, old_axis)
    axis = old_axis + wn + cross(w, wn) / np.maximum(1 + c, 1e-6)
    axis = _unit(axis - way * _dot(axis, way))[0]

    cosine = np.clip((a * a + distance * distance - b * b) / (2 * a * distance), -1, 1)
    new_knee = hip + a * (cosine * way + np.sqrt(1 - cosine * cosine) * cross(way, axis))
    return new_knee, hip + distance * way, axis, old_axis


def _soften(distance: Array, before: Array, length: Array) -> Array:
    """Clamp the distance a limb spans: soft near full length, but never shorter than it already was for the same target."""
    start = np.maximum(SOFT_REACH * length, np.minimum(before, (FULL_REACH - 1e-4) * length))
    room = FULL_REACH * length - start
    over = np.maximum(distance - start, 0)
    return np.maximum(np.where(over > 0, start + room * -np.expm1(-over / room), distance), TIGHTEST * length)


def _carry(bone: Array, axis: Array, new_bone: Array, new_axis: Array) -> Array:
    """Rotations (..., 4) that turn bones onto new bones and, about them, the bending axis onto the new one, all (..., 3)."""
    x, new_x = _unit(bone)[0], _unit(new_bone)[0]
    y, new_y = _unit(axis - x * _dot(axis, x))[0], _unit(new_axis - new_x * _dot(new_axis, new_x))[0]
    cosine = _dot(x, new_x)
    # A bone turned right about swings on its bending axis.
    swing = np.concatenate((np.maximum(1 + cosine, 0), np.where(1 + cosine < 1e-9, y, cross(x, new_x))), axis=-1)
    swing = _unit(swing)[0]
    y = rotate(swing, y)
    cosine = np.clip(_dot(y, new_y), -1, 1)
    twist = np.concatenate(
        (np.sqrt((1 + cosine) / 2), np.copysign(np.sqrt((1 - cosine) / 2), _dot(cross(y, new_y), new_x)) * new_x), axis=-1
    )
    return mul(twist, swing)


def _ramp(x: Array, low: float, high: float) -> Array:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(-1, keepdims=True)


def _length(v: Array) -> Array:
    return np.sqrt((v * v).sum(-1, keepdims=True))


def _unit(v: Array) -> tuple[Array, Array]:
    n = _length(v)
    return v / np.maximum(n, 1e-9), n
