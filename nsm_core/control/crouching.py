"""How one goes down for what a hand takes low: hips sink and go back, the trunk pitches over them, the head
stays up, and all that keeps out of what stands there.

A solver that goes the least way from standing to where a shoulder reaches bows into the board before it, or
kneels, or swings from the one to the other.  So of every few frames a fan of crouches is tried, each with its
feet where they stand, and the sequence is taken that reaches, has most room, stands with most ease and
changes the least (dynamic programming); the solver then only finishes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.capsules import Figure
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.ik.footsteps import Footsteps
from nsm_core.body.ik.solver import Pose
from nsm_core.body.ik.two_bone import place_on
from nsm_core.body.skeleton import ARMS, FEET, INDEX, JOINTS
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.signals import cheapest_sequence, gaussian_smooth

EVERY = 4  # frames between those that are looked at
AROUND = 30  # frames before and after a shoulder is too far off in which one may go down and come up
# The fan: metres that hips sink and go back, radians that the trunk pitches.
SINKS, BACK, PITCH = np.linspace(0.0, 0.6, 7), np.linspace(0.0, 0.3, 4), np.radians(np.linspace(0, 75, 6))
_FAN = np.stack(np.meshgrid(SINKS, BACK, PITCH, indexing="ij"), -1).reshape(-1, 3)
# Shares of the pitch by joint: hips tilt under a back that bends, neck and head look up again, and upper arms
# stay as they hung.
_SHARES = {"Hips": 0.5, "Chest": 0.15, "Chest2": 0.15, "Chest3": 0.1, "Chest4": 0.1, "Neck": -0.25,
           "Head": -0.25, "RightShoulder": -0.9, "LeftShoulder": -0.9}  # fmt: skip
SPLAY, _SPLAYED = np.radians(25), 0.5  # by which knees go apart, and the metres of sinking that it takes
ROOM = 0.03  # metres about a body from which on more is no better
# That cost as much: metres that a shoulder lacks or a body is in something, or an arm; metres, and radians,
# of sinking, of going back, of pitch; metres off balance, beside so many that are at no cost.
_LACK, _DEEP, _ARM, _EASE, _OFF, _BALANCED = 0.015, 0.01, 0.03, np.array((0.22, 0.3, 1.4)), 0.04, 0.05
_CHANGE = np.array((0.05, 0.05, 0.15))  # from one frame that is looked at to the next
# Radians by which an arm that hangs swings back, those that cost as much as a centimetre in something, and by
# which it changes from one frame that is looked at to the next; metres about it that are free.
SWINGS, _SWUNG, _SWINGS_CHANGE, _BESIDE = np.radians(np.arange(0, 91, 15)), 0.8, 0.3, 0.01
_LIKELY, _ELSE = 40, 100.0  # crouches of a frame whose room is looked at, and what the others cost more
_BODY = ("Hips", "Chest", "Neck", "Head", "RightHip", "LeftHip", "RightKnee", "LeftKnee")
_LIMBS = tuple(leg[:3] for leg in FEET)
_ALONG = np.linspace(0.3, 0.85, 4)  # shares of the way from shoulder to wrist at which an arm is looked at
_ARM_RADIUS = 0.045


@dataclass(frozen=True)
class Crouched:
    """Who is to go down: ``headings`` (T,) of the body, the ``feet`` that stand, the ``shoulders``' joints,
    and for each the ``targets`` (T, 2, 3) it is to be within ``reach`` (T, 2) metres of, infinite where
    nothing is asked.
    """

    headings: Array
    feet: Footsteps
    targets: Array
    reach: Array

    def lack(self, pose: Pose, frames: Array) -> Array:
        """Metres (N,) that the shoulders of poses in ``frames`` (N,) lack to be as near as they are to be."""
        shoulders = pose.positions[:, [arm[0] for arm in ARMS]]
        away = np.linalg.norm(self.targets[frames] - shoulders, axis=-1)
        return np.asarray(np.maximum(away - self.reach[frames], 0.0).max(1))

    def across(self, frames: Array) -> Array:
        """Unit ways (N, 3) to the left of the body, about which what is upright pitches ahead."""
        ahead = heading_to_direction(self.headings[frames])
        return np.column_stack((-ahead[:, 1], ahead[:, 0], np.zeros(len(frames))))

    def down(self, pose: Pose, frames: Array, how: Array) -> Pose:
        """Poses of ``frames`` (N,) that go down as ``how`` (N, 3) tells: hips that sink and go back, metres,
        a trunk that pitches, radians; feet stand.
        """
        ahead, across = heading_to_direction(self.headings[frames]), self.across(frames)
        step = np.zeros((len(frames), 3 + 3 * len(pose.tree.parents)))
        step[:, :2], step[:, 2] = -how[:, 1:2] * ahead, -how[:, 0]
        turns = step[:, 3:].reshape(len(frames), -1, 3)
        for name, share in _SHARES.items():
            turns[:, INDEX[name]] = share * how[:, 2:] * across
        out = pose.moved(step)
        ankles, turned = self.feet.ankles[frames], self.feet.rotations[frames]
        out = Pose(out.tree, out.hips, place_on(out.tree, out.hips, out.local, _LIMBS, ankles, turned))
        splay = SPLAY * np.clip(how[:, 0] / _SPLAYED, 0, 1)
        step = np.zeros_like(step)
        turns = step[:, 3:].reshape(len(frames), -1, 3)
        for side, (hip, _, ankle) in zip((1, -1), _LIMBS, strict=True):
            line = out.positions[:, ankle] - out.positions[:, hip]
            line /= np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-9)
            turns[:, hip] = side * splay[:, None] * line
        out = out.moved(step)
        return Pose(out.tree, out.hips, place_on(out.tree, out.hips, out.local, _LIMBS, ankles, turned))


def crouched(pose: Pose, who: Crouched, solids: Sequence[Obstacle], figure: Figure) -> Pose:
    """The motion gone down where its shoulders lack reach; the same where none does."""
    every = np.arange(len(pose.hips))
    short = who.lack(pose, every) > 0
    if not short.any():
        return pose
    wide = np.convolve(short, np.ones(2 * AROUND + 1), "same") > 0
    seen = every[::EVERY]
    cost = np.full((len(seen), len(_FAN)), np.inf)
    cost[:, 0] = 0.0
    asked = np.flatnonzero(wide[seen])
    cost[asked] = _price(pose, who, seen[asked], solids, figure)
    chosen = _FAN[cheapest_sequence(cost, _changes(_FAN / _CHANGE))]
    how = np.stack([np.interp(every, seen, column) for column in chosen.T], -1)
    pose = who.down(pose, every, gaussian_smooth(how, 1.5 * EVERY))
    return _hanging(pose, who, solids, figure)


def _hanging(pose: Pose, who: Crouched, solids: Sequence[Obstacle], figure: Figure) -> Pose:
    """The motion with arms that hang swung back as far as it takes to be out of what stands before the body,
    as one leans and on the way.
    """
    every = np.arange(len(pose.hips))
    seen = every[::EVERY]
    when, swing = np.repeat(seen, len(SWINGS)), np.tile(SWINGS, len(seen))
    first = [name.split("-")[0] for name in figure.spheres.names]
    for side, arm in enumerate(ARMS):
        spheres = figure.spheres.only(np.flatnonzero([n in [JOINTS[j] for j in arm] for n in first]))
        part = _swung(pose.part(when), arm[0], swing[:, None] * who.across(when))
        centres, radii = spheres.of(part.positions, part.world)
        lack = _lack(centres, radii + _BESIDE, when, solids)
        lack[np.isfinite(who.reach[when, side])] = 0.0  # a hand that is led goes its own way
        cost = ((lack / _DEEP) ** 2 + (swing / _SWUNG) ** 2).reshape(len(seen), -1)
        chosen = np.interp(
            every, seen, SWINGS[cheapest_sequence(cost, _changes(SWINGS[:, None] / _SWINGS_CHANGE))]
        )
        turn = gaussian_smooth(chosen, float(EVERY))[:, None] * who.across(every)
        pose = _swung(pose, arm[0], turn)
    return pose


def _swung(pose: Pose, joint: int, turn: Array) -> Pose:
    """Poses with a joint turned by world rotation vectors ``turn`` (N, 3)."""
    step = np.zeros((len(turn), 3 + 3 * len(pose.tree.parents)))
    step[:, 3 + 3 * joint : 6 + 3 * joint] = turn
    return pose.moved(step)


def _price(pose: Pose, who: Crouched, frames: Array, solids: Sequence[Obstacle], figure: Figure) -> Array:
    """What the crouches of the fan cost (N, F) in ``frames`` (N,)."""
    when, how = np.repeat(frames, len(_FAN)), np.tile(_FAN, (len(frames), 1))
    cost = ((how / _EASE) ** 2).sum(1)
    part = who.down(pose.part(when), when, how)
    cost += (who.lack(part, when) / _LACK) ** 2 + (_off_balance(part, who.headings[when]) / _OFF) ** 2
    cost = cost.reshape(len(frames), -1)
    likely = np.argpartition(cost, _LIKELY, axis=1)[:, :_LIKELY]
    likely = (likely + len(_FAN) * np.arange(len(frames))[:, None]).ravel()
    part, when, cost = part.part(likely), when[likely], cost.ravel() + _ELSE
    cost[likely] += (_deep(part, when, solids, figure) / _DEEP) ** 2 - _ELSE
    cost[likely] += (_arm_deep(part, who, when, solids) / _ARM) ** 2
    return cost.reshape(len(frames), -1)


def _off_balance(pose: Pose, headings: Array) -> Array:
    """Metres (N,) by which the body's mass is ahead of or behind its feet, beyond what is at ease: more than
    half of it about the chest, the rest about the thighs, but for shanks and feet.
    """
    at = pose.positions
    feet = at[:, [leg[k] for leg in FEET for k in (2, 3)]].mean(1)
    thighs = at[:, [leg[k] for leg in FEET for k in (0, 1)]].mean(1)
    mass = 0.6 * at[:, INDEX["Chest3"]] + 0.25 * thighs + 0.15 * feet
    ahead = ((mass - feet)[:, :2] * heading_to_direction(headings)).sum(1)
    return np.asarray(np.maximum(np.abs(ahead) - _BALANCED, 0.0))


def _deep(pose: Pose, frames: Array, solids: Sequence[Obstacle], figure: Figure) -> Array:
    """Metres (N,) that trunk, head and legs of poses in ``frames`` (N,) lack to have room."""
    names = [name.split("-")[0] for name in figure.spheres.names]
    own = np.flatnonzero([any(n.startswith(b) for b in _BODY) and "Shoulder" not in n for n in names])
    spheres = figure.spheres.only(own[::2])
    centres, radii = spheres.of(pose.positions, pose.world)
    return _lack(centres, radii + ROOM, frames, solids)


def _arm_deep(pose: Pose, who: Crouched, frames: Array, solids: Sequence[Obstacle]) -> Array:
    """Metres (N,) that lines from shoulders to where their hands are to be lack to have room for an arm."""
    shoulders = pose.positions[:, [arm[0] for arm in ARMS]]
    line = shoulders[:, :, None] + _ALONG[:, None] * (who.targets[frames] - shoulders)[:, :, None]
    asked = np.isfinite(who.reach[frames])[..., None]
    need = np.broadcast_to(np.where(asked, _ARM_RADIUS, -np.inf), line.shape[:3])
    return _lack(line.reshape(len(frames), -1, 3), need.reshape(len(frames), -1), frames, solids)


def _lack(centres: Array, need: Array, frames: Array, solids: Sequence[Obstacle]) -> Array:
    """Metres (N,) that any of centres (N, S, 3) lacks at most to be ``need`` (N, S) off solids."""
    out = np.zeros(len(centres))
    flat, when = centres.reshape(-1, 3), np.repeat(frames, centres.shape[1])
    reach = float(np.max(need, initial=0.0)) + 0.01
    for solid in solids:
        far = solid.distance(when, flat, reach).reshape(need.shape)
        out = np.maximum(out, (need - far).max(1))
    return out


def _changes(fan: Array) -> Array:
    """What it costs (F, F) to go from one choice of a ``fan`` (F, K) to another: the square of how far they
    are apart.
    """
    return np.asarray(((fan[:, None] - fan) ** 2).sum(-1))


__all__ = ["Crouched", "crouched"]
