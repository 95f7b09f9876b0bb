"""Two-bone inverse kinematics in closed form: legs and arms put their ends where they are told.

Everything is vectorised over leading axes, so a frame and a whole take cost the same number of calls.
A limb keeps the plane it is bent in; a nearly straight one bends as the joint does (knees forward), and never
backward.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nsm_core.body.skeleton import ARMS, FEET, INDEX, OFFSETS, PARENTS, J
from nsm_core.body.tree import Tree
from nsm_core.components import (
    Arrays,
    Kind,
    Numbers,
    Quaternion,
    Vector,
    along,
    cross,
    dot,
    inverse,
    length,
    minus,
    packed,
    plus,
    product,
    split,
    times,
    turned,
    unit,
    unit_turn,
)
from nsm_core.rotations import Array, quat_mul, quat_rotate

# Hinge axis of knee and elbow in the rest frame of the upper bone: turning the lower bone about it flexes the
# joint.
_HINGES = np.zeros((J, 3))
_HINGES[[INDEX["RightKnee"], INDEX["LeftKnee"]], 0] = 1
_HINGES[[INDEX["RightElbow"], INDEX["LeftElbow"]], 2] = 1, -1
_BONES = OFFSETS.astype(np.float64).tolist()
_REST = {
    chain[1:3]: (_BONES[chain[1]], _BONES[chain[2]], _HINGES[chain[1]].tolist()) for chain in (*FEET, *ARMS)
}
_FEW = 4  # poses up to which numbers are quicker than arrays
# Of the length of the straight limb: where the reach begins to soften, its end, and the tightest fold.
SOFT_REACH, FULL_REACH, TIGHTEST = 0.99, 0.9995, 0.15
# The plane of a bend this small is noise (sine of the bend); and of its sine by the new one, where it is not
# to be magnified.
_STRAIGHT, _BENT = 0.02, 0.12
_MAGNIFIED, _LIKE = 0.3, 0.8


def place_limb(
    hips_position: Array,
    local_rotations: Array,
    chain: tuple[int, int, int],
    target: Array,
    end_rotation: Array | None = None,
) -> Array:
    """Put the end of a limb at a target by turning its two bones; return new (..., 23, 4) local rotations.

    Args:
        hips_position: (..., 3) world, metres.
        local_rotations: (..., 23, 4) parent-relative.
        chain: joints of the limb's start, middle and end, such as ``skeleton.ARMS[0]`` or
        ``skeleton.FEET[0][:3]``. target: (..., 3) world position for the end joint. end_rotation: (..., 4)
        world rotation for the end joint; None keeps the world rotation it had.

    All other joints keep their local rotations.  What is out of reach is approached softly, without a pop at
    full length.  A limb keeps the plane that it is bent in; one that is nearly straight, or bent the wrong
    way, bends about the joint's hinge.
    """
    return place_limbs(
        hips_position,
        local_rotations,
        (chain,),
        target[..., None, :],
        None if end_rotation is None else end_rotation[..., None, :],
    )


def place_limbs(
    hips_position: Array,
    local_rotations: Array,
    chains: Sequence[tuple[int, int, int]],
    targets: Array,
    end_rotations: Array | None = None,
) -> Array:
    """Put the ends of several limbs at targets at once; as ``place_limb`` with (..., L, 3) targets and (...,
    L, 4) rotations.

    The limbs must not hang on one another.
    """
    dtype, lead = local_rotations.dtype, local_rotations.shape[:-2]
    local = local_rotations.astype(np.float64)
    starts, middles, ends = (list(joints) for joints in zip(*chains, strict=True))
    targets = _filled(targets, (*lead, len(chains), 3))
    if end_rotations is not None:
        end_rotations = _filled(end_rotations, (*lead, len(chains), 4))
    if local.size > _FEW * J * 4:
        position, parent = (split(a) for a in chain_frames(hips_position, local, tuple(starts)))
        old = tuple(split(local[..., joints, :]) for joints in (starts, middles, ends))
        rest = tuple(
            split(a)
            for a in (OFFSETS[middles].astype(np.float64), OFFSETS[ends].astype(np.float64), _HINGES[middles])
        )
        end = None if end_rotations is None else split(end_rotations)
        new = _place(Arrays, position, parent, old, rest, split(targets), end)
        for joints, rotation in zip((starts, middles, ends), new, strict=True):
            local[..., joints, :] = packed(rotation)
        return local.astype(dtype)
    poses, goals = local.reshape(-1, J, 4), targets.reshape(-1, len(chains), 3).tolist()
    hips = _filled(hips_position, (*lead, 3)).reshape(-1, 3).tolist()
    last = None if end_rotations is None else end_rotations.reshape(-1, len(chains), 4).tolist()
    for n, pose in enumerate(poses.tolist()):
        placed: list[Quaternion] = []
        for k, ((position, parent), chain) in enumerate(
            zip(_frames(hips[n], pose, starts), chains, strict=True)
        ):
            turns, end = [pose[j] for j in chain], None if last is None else last[n][k]
            placed.extend(_place(Numbers, position, parent, turns, _REST[chain[1:]], goals[n][k], end))
        poses[n, [j for chain in chains for j in chain]] = placed
    return poses.reshape(local.shape).astype(dtype, copy=False)


def place_on(
    tree: Tree,
    hips: Array,
    local: Array,
    chains: Sequence[tuple[int, int, int]],
    targets: Array,
    end_rotations: Array | None = None,
) -> Array:
    """``place_limbs`` of motions (T, ...) of a body of any proportions whose joints are those of
    ``skeleton``.
    """
    positions, world = tree.forward(hips, local)
    starts, middles, ends = (list(joints) for joints in zip(*chains, strict=True))
    parent = world[:, np.array(tree.parents)[starts]]
    old = tuple(split(local[:, joints]) for joints in (starts, middles, ends))
    bones = tree.offsets[middles], tree.offsets[ends], _HINGES[middles]
    rest = tuple(split(a.astype(np.float64)) for a in bones)
    end = None if end_rotations is None else split(end_rotations)
    new = _place(Arrays, split(positions[:, starts]), split(parent), old, rest, split(targets), end)
    out = np.array(local, dtype=np.float64)
    for joints, rotation in zip((starts, middles, ends), new, strict=True):
        out[:, joints] = packed(rotation)
    return out


def place_wrists(
    hips_position: Array,
    local_rotations: Array,
    side: int,
    wrist_target: Array,
    wrist_rotation: Array | None = None,
) -> Array:
    """Put the wrist of one arm, ``side`` 0 right or 1 left, at a target (..., 3); as ``place_limb``."""
    return place_limb(hips_position, local_rotations, ARMS[side], wrist_target, wrist_rotation)


def chain_frames(
    hips_position: Array, local_rotations: Array, joints: tuple[int, ...]
) -> tuple[Array, Array]:
    """World position (..., L, 3) of ``joints`` and world rotation (..., L, 4) of their parents, walking only
    their ancestors.
    """
    if local_rotations.ndim == 2:
        frames = _frames(np.asarray(hips_position).tolist(), local_rotations.tolist(), joints)
        position, rotation = (np.array(a, dtype=local_rotations.dtype) for a in zip(*frames, strict=True))
        return position, rotation
    known = {0: (np.asarray(hips_position, dtype=local_rotations.dtype), local_rotations[..., 0, :])}

    def frame(j: int) -> tuple[Array, Array]:
        if j not in known:
            p, r = frame(PARENTS[j])
            known[j] = (
                p + quat_rotate(r, OFFSETS[j].astype(r.dtype)),
                quat_mul(r, local_rotations[..., j, :]),
            )
        return known[j]

    parents = [frame(PARENTS[j]) for j in joints]
    rotation = np.stack([r for _, r in parents], axis=-2)
    return np.stack([p for p, _ in parents], axis=-2) + quat_rotate(
        rotation, OFFSETS[list(joints)].astype(rotation.dtype)
    ), rotation


def _frames(hips: Vector, pose: list[Quaternion], joints: Sequence[int]) -> list[tuple[Vector, Quaternion]]:
    """``chain_frames`` of one pose in numbers: position and parent's rotation of each joint."""
    known = {0: (hips, pose[0])}

    def frame(j: int) -> tuple[Vector, Quaternion]:
        if j not in known:
            p, r = frame(PARENTS[j])
            known[j] = (plus(p, turned(r, _BONES[j])), product(r, pose[j]))
        return known[j]

    parents = [(frame(PARENTS[j]), _BONES[j]) for j in joints]
    return [(plus(p, turned(r, bone)), r) for (p, r), bone in parents]


def leg_reach() -> float:
    """Length of a leg, hip joint to ankle, that is reached without softening, metres."""
    return SOFT_REACH * float(np.linalg.norm(OFFSETS[list(FEET[0][1:3])], axis=-1).sum())


def _filled(values: Array, shape: tuple[int, ...]) -> Array:
    """Values as float64 of a shape."""
    values = np.asarray(values, dtype=np.float64)
    return values if values.shape == shape else np.broadcast_to(values, shape)


def _place(
    of: Kind,
    start: Vector,
    parent: Quaternion,
    old: Sequence[Quaternion],
    rest: tuple[Vector, Vector, Vector],
    target: Vector,
    end_rotation: Quaternion | None,
) -> tuple[Quaternion, Quaternion, Quaternion]:
    """New local rotations of a limb's three joints in components; ``rest`` are its two bones and its hinge in
    the rest pose.
    """
    upper = product(parent, old[0])
    lower = product(upper, old[1])
    if end_rotation is None:
        end_rotation = product(lower, old[2])
    first, second, hinge = turned(upper, rest[0]), turned(lower, rest[1]), turned(upper, rest[2])
    knee = plus(start, first)
    new_knee, new_ankle, axis, old_axis = _solve(of, start, knee, plus(knee, second), target, hinge)
    # Each bone turns by what carries its direction and the bending axis from before to after.
    new_upper = product(_carry(of, first, old_axis, minus(new_knee, start), axis), upper)
    new_lower = product(_carry(of, second, old_axis, minus(new_ankle, new_knee), axis), lower)
    return (
        product(inverse(parent), new_upper),
        product(inverse(new_upper), new_lower),
        product(inverse(new_lower), end_rotation),
    )


def _solve(
    of: Kind, hip: Vector, knee: Vector, ankle: Vector, target: Vector, hinge: Vector
) -> tuple[Vector, Vector, Vector, Vector]:
    """The new knee and ankle of a limb whose end meets a target, and the axes about which it is bent now and
    was before, in components.

    ``hinge`` is the axis about which the limb flexes by the right-hand rule (a person's right for knees).
    """
    upper, lower = minus(knee, hip), minus(ankle, knee)
    a, b = length(of, upper), length(of, lower)
    before, before_length = _unit(of, minus(ankle, hip))
    way, distance = _unit(of, minus(target, hip))
    there = distance > 1e-6
    way = (
        of.where(there, way[0], before[0]),
        of.where(there, way[1], before[1]),
        of.where(there, way[2], before[2]),
    )
    distance = _soften(of, distance, before_length, a + b)

    # The plane of the bend: the limb's own where it is clearly bent, else the joint's hinge.  A limb that was
    # nearly straight and is to bend much would magnify the noise of its own plane into swings of the knee.
    bend = times(cross(upper, lower), 1 / (a * b))
    hinge = unit(of, along(hinge, before, -dot(hinge, before)))
    sine = length(of, bend)
    new_cosine = (distance * distance - a * a - b * b) / (2 * a * b)
    new_sine = of.sqrt(of.most(1 - new_cosine * new_cosine, 1e-6))
    own: Any = _ramp(of, sine, _STRAIGHT, _BENT) * of.most(
        _ramp(of, sine / new_sine, _MAGNIFIED, _LIKE), _ramp(of, sine, 0.4, 0.6)
    )
    own = of.where(dot(bend, hinge) > 0, own, 0.0)
    old_axis = unit(of, along(times(hinge, 1 - own), bend, own / of.most(sine, 1e-9)))
    # Swing that plane along with the line from start to end.
    w, c = cross(before, way), dot(before, way)
    wn = cross(w, old_axis)
    axis = along(plus(old_axis, wn), cross(w, wn), 1 / of.most(1 + c, 1e-6))
    axis = unit(of, along(axis, way, -dot(axis, way)))

    cosine = _within_one(of, (a * a + distance * distance - b * b) / (2 * a * distance))
    new_knee = along(along(hip, way, a * cosine), cross(way, axis), a * of.sqrt(1 - cosine * cosine))
    return new_knee, along(hip, way, distance), axis, old_axis


def _soften(of: Kind, distance: Any, before: Any, straight: Any) -> Any:
    """Clamp the distance a limb spans: soft near full length, but never shorter than it already was for the
    same target.
    """
    start = of.most(SOFT_REACH * straight, of.least(before, (FULL_REACH - 1e-4) * straight))
    room = FULL_REACH * straight - start
    over = of.most(distance - start, 0.0)
    return of.most(of.where(over > 0, start + room * -of.expm1(-over / room), distance), TIGHTEST * straight)


def _carry(of: Kind, bone: Vector, axis: Vector, new_bone: Vector, new_axis: Vector) -> Quaternion:
    """Rotations that turn bones onto new bones and, about them, the bending axis onto the new one, in
    components.
    """
    x, new_x = unit(of, bone), unit(of, new_bone)
    y, new_y = (
        unit(of, along(axis, x, -dot(axis, x))),
        unit(of, along(new_axis, new_x, -dot(new_axis, new_x))),
    )
    over = 1 + dot(x, new_x)
    # A bone turned right about swings on its bending axis.
    about = over < 1e-9
    swing = unit_turn(
        of, (of.most(over, 0.0), *[of.where(about, p, q) for p, q in zip(y, cross(x, new_x), strict=True)])
    )
    y = turned(swing, y)
    cosine = _within_one(of, dot(y, new_y))
    half = of.copysign(of.sqrt((1 - cosine) / 2), dot(cross(y, new_y), new_x))
    return product((of.sqrt((1 + cosine) / 2), *times(new_x, half)), swing)


def _ramp(of: Kind, x: float, low: float, high: float) -> float:
    t = of.most(of.least((x - low) / (high - low), 1.0), 0.0)
    return t * t * (3 - 2 * t)


def _within_one(of: Kind, x: float) -> float:
    return of.most(of.least(x, 1.0), -1.0)


def _unit(of: Kind, v: Vector) -> tuple[Vector, float]:
    far = length(of, v)
    return times(v, 1 / of.most(far, 1e-9)), far
