"""What a load weighs on who carries it: a body that leans back, shoulders that drop, a slower walk.

A load of m kilograms, its middle d metres before the hips, turns a body of M over by m g d.  Half of that the
whole body balances about its ankles, M g h sin(a) with its centre h over them, and a quarter the trunk about
the hips, with its share of M and its centre over those; the last quarter is the feet's: the centre of
pressure moves toward the toes.  With a tenth of the body's weight in hands that is 5 degrees of the trunk, as
people measured with loads before them lean.  Who carries no more than that walks as fast as without; beyond,
the pace falls as the share of the body's weight grows.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import ANKLES
from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_rotate,
)
from nsm_core.signals import gaussian_smooth, smooth_step

BODY = 75.0  # kilograms of the network's body
CENTRE = 0.9  # metres of its centre over the ankles
TRUNK, TRUNK_CENTRE = 0.6, 0.32  # share of it over the hips, and metres of that part's centre over them
BALANCED, TRUNKS = 0.5, 0.25  # shares of the load's moment that the whole body balances, and the trunk
MOST_LEAN, MOST_BACK = (
    np.radians(5),
    np.radians(14),
)  # of the body about the ankles, of the trunk over the hips
PELVIS = 0.6  # share of the trunk's lean that is the pelvis's, the rest its spine's
DROP, MOST_DROP = np.radians(0.45), np.radians(8)  # of a collar, by the kilogram, and at most
EASY, SLOWEST = 0.1, 0.75  # share of the body's weight that slows nobody; pace of the slowest
PACKED, MOST_PACKED = 150.0, 25.0  # kilograms a cubic metre, and of a box at most
_UPRIGHT = (0.7, 0.93)  # cosines of a trunk's pitch between which it comes to lean: who bends does not
_SPINE = [INDEX[name] for name in ("Chest", "Chest2", "Chest3")]
_SMOOTH = 5.0  # frames


def by_volume(size: Array) -> float:
    """Kilograms of a box of this ``size`` (3,), metres, of which nothing else is known: as packed goods."""
    return min(PACKED * float(np.prod(size)), MOST_PACKED)


def pace_with(kilograms: float) -> float:
    """Pace, as a share of the usual one, of who carries so much."""
    return float(np.clip(1 - (kilograms / BODY - EASY), SLOWEST, 1.0))


def leant(pose: Pose, kilograms: Array, places: Array) -> Pose:
    """The motion with loads of so many ``kilograms`` (T,) at ``places`` (T, 3), world, in its hands: hips and
    trunk lean back, the head stays as it is turned, collars drop.  Feet are put back by who plants them.
    """
    if not kilograms.any():
        return pose
    feet = pose.positions[:, ANKLES].mean(1)
    ahead = quat_rotate(pose.world[:, HIPS], np.broadcast_to((0.0, -1.0, 0.0), feet.shape)) * (1.0, 1.0, 0.0)
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-6)
    before = np.maximum(((places - pose.positions[:, HIPS]) * ahead).sum(1), 0.0)
    trunk = pose.positions[:, INDEX["Neck"]] - pose.positions[:, HIPS]
    upright = trunk[:, 2] / np.maximum(np.linalg.norm(trunk, axis=1), 1e-6)
    bears = kilograms * smooth_step((upright - _UPRIGHT[0]) / (_UPRIGHT[1] - _UPRIGHT[0]))
    moment = bears * before / BODY
    lean = np.minimum(np.arcsin(np.clip(BALANCED * moment / CENTRE, 0, 1)), MOST_LEAN)
    back = np.minimum(np.arcsin(np.clip(TRUNKS * moment / (TRUNK * TRUNK_CENTRE), 0, 1)), MOST_BACK)
    lean, back, drop = (
        gaussian_smooth(angle, _SMOOTH) for angle in (lean, back, np.minimum(DROP * bears, MOST_DROP))
    )
    aside = np.cross(np.eye(3)[2], ahead)  # a turn about it tips forward
    over = pose.positions[:, HIPS, 2] - feet[:, 2]
    hips = pose.hips - (over * np.sin(lean))[:, None] * ahead
    local = pose.local.copy()
    local[:, HIPS] = quat_mul(quat_from_rotvec(-(lean + PELVIS * back)[:, None] * aside), local[:, HIPS])
    for joint in _SPINE:
        local[:, joint] = _turned(pose, local, joint, -(1 - PELVIS) * back[:, None] / len(_SPINE) * aside)
    world = pose.tree.forward(hips, local)[1]
    for side, sign in (("Right", 1.0), ("Left", -1.0)):
        axis = quat_rotate(world[:, INDEX["Chest4"]], np.broadcast_to((0.0, -sign, 0.0), hips.shape))
        local[:, INDEX[side + "Collar"]] = _turned(
            pose, local, INDEX[side + "Collar"], drop[:, None] * axis, world
        )
    head = INDEX["Head"]
    world = pose.tree.forward(hips, local)[1]
    above = pose.tree.parents[head]
    local[:, head] = quat_mul(quat_conjugate(world[:, above]), pose.world[:, head])
    return Pose(pose.tree, hips, local)


def _turned(pose: Pose, local: Array, joint: int, turn: Array, world: Array | None = None) -> Array:
    """Local rotations (T, 4) of a joint that is turned by ``turn`` (T, 3), world."""
    world = pose.world if world is None else world
    above = world[:, pose.tree.parents[joint]]
    own = quat_mul(quat_mul(quat_conjugate(above), quat_from_rotvec(turn)), above)
    return np.asarray(quat_mul(own, local[:, joint]))


__all__ = ["by_volume", "leant", "pace_with"]
