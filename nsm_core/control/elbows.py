"""Elbows that go where arms have room: before the take is solved, an arm that is led is turned about the line
from its shoulder to its wrist, which both stay.

A solver that goes the least way out of a board may go over it or under it, and stays where it began; so of
every few frames a fan of turns is tried, and the sequence is taken that has most room, bends the wrist and
leaves the arm's own plane the least, and changes the least (dynamic programming).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.body.capsules import Figure
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import ARMS, JOINTS
from nsm_core.rotations import Array, quat_conjugate, quat_from_rotvec, quat_mul, quat_rotate
from nsm_core.signals import cheapest_sequence, gaussian_smooth

from .actions.hold import Lead

EVERY = 3  # frames between those that are looked at
FAN = np.radians(np.arange(-120, 121, 15))  # turns that are tried
ROOM = 0.02  # metres about an arm from which on more is no better
_EASY = np.radians(40)  # by which a wrist is bent at no cost
_LACK, _BEND, _AWAY, _CHANGE = 0.01, np.radians(15), np.radians(60), np.radians(20)  # that cost as much

# What it costs to go from one turn of the fan to another: one step at a time.
_APART = np.abs(np.subtract.outer(np.arange(len(FAN)), np.arange(len(FAN))))
_STEPS = np.where(_APART > 1, np.inf, _APART * ((FAN[1] - FAN[0]) / _CHANGE) ** 2)


def with_room(
    pose: Pose, leads: Sequence[Sequence[Lead]], solids: Sequence[Obstacle], figure: Figure
) -> Pose:
    """The motion with elbows turned where ``leads`` lead hands that a body bends for; ``pose`` has their
    wrists where they are led.  Hands keep their places and how they are turned.
    """
    led = np.zeros((len(leads), len(ARMS)), bool)
    for t, each in enumerate(leads):
        for lead in each:
            led[t, lead.hand] |= lead.bends and lead.share > 0
    for side in np.flatnonzero(led.any(0)):
        seen = np.arange(0, len(leads), EVERY)
        price = _price(pose, int(side), seen[led[seen, side]], solids, figure)
        cost = np.full((len(seen), len(FAN)), np.inf)
        cost[:, FAN == 0.0] = 0.0
        cost[led[seen, side]] = price
        turn = np.interp(np.arange(len(leads)), seen, FAN[cheapest_sequence(cost, _STEPS)])
        pose = turned(pose, int(side), gaussian_smooth(turn, float(EVERY)))
    return pose


def turned(pose: Pose, side: int, angle: Array) -> Pose:
    """The motion with the arm of a ``side`` turned by ``angle`` (T,) radians about the line from its
    shoulder to its wrist.
    """
    shoulder, elbow, wrist = ARMS[side]
    turn = _turn(pose, side, angle)
    local = np.array(pose.local)
    local[:, shoulder] = quat_mul(
        quat_conjugate(pose.above[:, shoulder]), quat_mul(turn, pose.world[:, shoulder])
    )
    lower = quat_mul(turn, pose.world[:, elbow])
    local[:, wrist] = quat_mul(quat_conjugate(lower), pose.world[:, wrist])
    return Pose(pose.tree, pose.hips, local)


def _turn(pose: Pose, side: int, angle: Array) -> Array:
    """World rotations (T, ..., 4) by angles (T, ...) about the line from shoulder to wrist."""
    way = pose.positions[:, ARMS[side][2]] - pose.positions[:, ARMS[side][0]]
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    return quat_from_rotvec(angle[..., None] * way.reshape(len(way), *(1,) * (angle.ndim - 1), 3))


def _price(pose: Pose, side: int, frames: Array, solids: Sequence[Obstacle], figure: Figure) -> Array:
    """What the turns of the fan cost (N, F) in ``frames`` (N,)."""
    part = pose.part(frames)
    centres, radii = figure.spheres.of(part.positions, part.world)
    names = figure.spheres.names
    shoulder, elbow, wrist = ARMS[side]
    arm = np.flatnonzero([n.startswith((f"{JOINTS[shoulder]}-", f"{JOINTS[elbow]}-")) for n in names])
    forearm = np.array([names[k].startswith(JOINTS[elbow]) for k in arm])
    trunk = np.flatnonzero([n.startswith(("Hips", "Chest")) and "Shoulder" not in n for n in names])
    turn = _turn(part, side, np.broadcast_to(FAN, (len(frames), len(FAN))))
    joint = part.positions[:, None, shoulder]
    spun = joint[:, :, None] + quat_rotate(turn[:, :, None], (centres[:, arm] - joint)[:, None])
    need = (radii[:, arm] + ROOM)[:, None]
    lack = np.zeros(spun.shape[:2])
    flat, when = spun.reshape(-1, 3), np.repeat(frames, len(FAN) * len(arm))
    for solid in solids:
        near = np.repeat(solid.distance(frames, part.positions[:, wrist], 1.0) < 1.0, len(FAN) * len(arm))
        if near.any():
            far = np.full(len(flat), np.inf)
            far[near] = solid.distance(when[near], flat[near], float(need.max()) + 0.02)
            own = 0.0 if solid.free is None else solid.free[frames][:, None, arm]
            lack = np.maximum(lack, (need - own - far.reshape(spun.shape[:3])).max(2))
    body = np.linalg.norm(spun[:, :, forearm, None] - centres[:, None, None, trunk], axis=-1)
    inside = radii[:, arm][:, None, forearm, None] + radii[:, None, None, trunk] - body
    ahead = (-1.0 if side == 0 else 1.0) * np.eye(3)[0]
    hand = quat_rotate(part.world[:, wrist], np.broadcast_to(ahead, joint[:, 0].shape))
    lower = quat_rotate(turn, (part.positions[:, wrist] - part.positions[:, elbow])[:, None])
    lower /= np.maximum(np.linalg.norm(lower, axis=-1, keepdims=True), 1e-9)
    bend = np.arccos(np.clip((lower * hand[:, None]).sum(-1), -1, 1))
    return np.asarray(
        (lack / _LACK) ** 2
        + (np.maximum(inside.max((2, 3)), 0) / _LACK) ** 2
        + (np.maximum(bend - _EASY, 0) / _BEND) ** 2
        + (FAN / _AWAY) ** 2
    )


__all__ = ["EVERY", "FAN", "turned", "with_room"]
