"""Rotations of joints from their places: the pose of a skeleton whose joints lie nearest to those that a
network tells, in closed form.

A joint with several bones turns by what fits them all; a limb's first joint by its bone and the plane that
it bends in, about the axis that it has there in a pose that is near: whose arm is twisted against its elbow's
hinge keeps that; every other one by the least turn from that pose, feet from how that has them in the
world, since a foot keeps its sole to the ground.  What places do not tell (the twist of a bone on which
nothing hangs, hands, toes and the head) stays as that pose has it.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import ANKLES
from nsm_core.body.skeleton import ARMS, FEET, OFFSETS, PARENTS, J, forward_kinematics
from nsm_core.rotations import (
    Array,
    cross,
    quat_conjugate,
    quat_from_axis_angle,
    quat_from_matrix,
    quat_mul,
    quat_normalize,
    quat_rotate,
)
from nsm_core.signals import smooth_step

_CHILDREN = tuple(tuple(j for j, p in enumerate(PARENTS) if p == i) for i in range(J))
_OFFSETS = OFFSETS.astype(np.float64)
# First joints of limbs, with the joint in their middle, their end, and the hinge of the middle joint.
_LIMBS = {
    **{leg[0]: (leg[1], leg[2], (1.0, 0.0, 0.0)) for leg in FEET},
    ARMS[0][0]: (ARMS[0][1], ARMS[0][2], (0.0, 0.0, 1.0)),
    ARMS[1][0]: (ARMS[1][1], ARMS[1][2], (0.0, 0.0, -1.0)),
}
_STRAIGHT = (0.1, 0.35)  # sine of a limb's bend from which its plane is read, and from which it is it alone


def pose_from_places(places: Array, near: Array) -> Array:
    """Local rotations (T, 23, 4), float64, of poses with joints as near as may be to ``places`` (T, 23, 3),
    world metres; ``near`` (T, 23, 4) are local rotations of poses like them.
    """
    places, near = places.astype(np.float64), near.astype(np.float64)
    world, local = np.empty_like(near), near.copy()
    soles = forward_kinematics(places[:, 0], near)[1]
    for joint in range(J):
        parent = PARENTS[joint]
        above = world[:, parent] if parent >= 0 else np.broadcast_to((1.0, 0, 0, 0), near[:, 0].shape)
        turn = soles[:, joint] if joint in ANKLES else quat_mul(above, near[:, joint])
        bones = _CHILDREN[joint]
        if len(bones) > 1:
            turn = _fitted(_OFFSETS[list(bones)], places[:, list(bones)] - places[:, joint, None])
        elif bones:
            turn = _swung(turn, _OFFSETS[bones[0]], places[:, bones[0]] - places[:, joint])
            if joint in _LIMBS:
                turn = _in_plane(turn, joint, places, near)
        world[:, joint] = turn
        local[:, joint] = quat_mul(quat_conjugate(above), turn)
    return quat_normalize(local)


def _fitted(bones: Array, ways: Array) -> Array:
    """World rotations (T, 4) that turn ``bones`` (N, 3) onto ``ways`` (T, N, 3) best, in least squares."""
    u, _, v = np.linalg.svd(np.einsum("tni,nj->tij", ways, bones))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ v))[:, None]
    return quat_from_matrix(u @ v)


def _swung(turn: Array, bone: Array, way: Array) -> Array:
    """Rotations (T, 4), turned the least so that ``bone`` (3,) points along ``way`` (T, 3)."""
    old = _unit(quat_rotate(turn, np.broadcast_to(bone, way.shape)))
    new = _unit(way)
    half = np.concatenate((1 + (old * new).sum(-1, keepdims=True), cross(old, new)), axis=-1)
    return quat_mul(quat_normalize(half), turn)


def _in_plane(turn: Array, joint: int, places: Array, near: Array) -> Array:
    """The rotations (T, 4) of a limb's first joint, twisted so that its middle joint can bend as it does in
    ``near``, where that tells it, else about its hinge.
    """
    middle, end, hinge = _LIMBS[joint]
    bone, hinges = (np.broadcast_to(v, places[:, 0].shape) for v in (_unit(_OFFSETS[middle]), hinge))
    lower = quat_rotate(near[:, middle], np.broadcast_to(_unit(_OFFSETS[end]), bone.shape))
    hinges = quat_rotate(quat_from_axis_angle(bone, _twist(bone, lower, hinges)), hinges)
    upper, lower = (_unit(places[:, b] - places[:, a]) for a, b in ((joint, middle), (middle, end)))
    return quat_mul(quat_from_axis_angle(upper, _twist(upper, lower, quat_rotate(turn, hinges))), turn)


def _twist(upper: Array, lower: Array, hinge: Array) -> Array:
    """Radians (T,) about the upper bone by which the axis that a limb bends about is off its ``hinge``, the
    less the straighter it is; bones and hinges (T, 3) are unit vectors.
    """
    bend = cross(upper, lower)
    axis = _unit(hinge - (hinge * upper).sum(-1, keepdims=True) * upper)
    angle = np.arctan2((cross(axis, bend) * upper).sum(-1), (axis * bend).sum(-1))
    sine = np.linalg.norm(bend, axis=-1)
    share = smooth_step((sine - _STRAIGHT[0]) / (_STRAIGHT[1] - _STRAIGHT[0]))
    # A plane seen from behind would be a limb bent the wrong way: noise of places that are nearly straight.
    return np.asarray(np.where(np.abs(angle) < np.pi / 2, share * angle, 0.0))


def _unit(v: Array) -> Array:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


__all__ = ["pose_from_places"]
