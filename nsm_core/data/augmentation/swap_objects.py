"""Composed takes with other objects in them: steps 3 to 5 of the augmentation (papers/000 section 5.2), for a
whole take.

What somebody sits on, climbs or carries is replaced by others of their kind at random scale, and the motion
is transferred onto them.  What does not come out as sound as it was keeps its object.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.body.contacts import RESTING
from nsm_core.body.skeleton import ARMS, FEET, HIP_OVER_SEAT, HIPS, forward_kinematics
from nsm_core.body.thin_capsules import thin_spheres
from nsm_core.conventions import CLIMB, FOOT_CONTACTS, FPS, HAND_CONTACTS, HIP_CONTACT, SIT
from nsm_core.data.scenarios.take import ComposedTake, Thing, TimedCommand
from nsm_core.distances import FOOT_OVER_EDGE, SEATS_SWAPPED
from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.signals import intervals
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.assets.pool import Pool, scaled
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.furniture import Furniture, cuboids

from .contact_transfer import Embedded, align, embed, switch, transfer
from .soundness import AROUND, ASTRAY, DEEPER, depth_in_solids, no_faster
from .swap_boxes import switch_box

# Of the differences in size between an object and the one drawn for it: what is left of them in one attempt
# after the other.
SHARES = (1.0, 0.8, 0.6, 0.4, 0.25)
MOST_BACK = 0.12  # metres that a seat stands further back at most
KEEP_OFF = 0.15  # metres that the hips keep from an object which they only pass
_LABELS = {"sit": SIT, "idle+walk": CLIMB}  # of the commands whose objects are switched
_ON_REST = 0.03  # metres from an arm rest at which a wrist still rests on it
_TOES = [leg[3] for leg in FEET]


def switched(take: ComposedTake, pool: Pool | None, seed: int) -> ComposedTake | None:
    """Return ``take`` with other objects for its sits, climbs and carries, drawn by ``seed``; None where none
    could be switched.

    ``pool`` None draws parametric pieces.  The body, goals and object poses follow the new objects (``take``
    stays as it is); labels, foot contacts and phase keys hold, because feet stay where they stand unless they
    stand on the object.
    """
    pool = Pool() if pool is None else pool
    rng = np.random.default_rng(seed)
    result, done = take, set()
    for number, command in enumerate(take.commands):
        if command.action not in (*_LABELS, "carry") or command.thing < 0 or command.thing in done:
            continue
        seeds = rng.integers(2**31, size=len(SHARES))
        if command.action == "carry":
            other = switch_box(result, number, pool, seeds, SHARES)
        else:
            other = _switch_one(result, number, pool, seeds)
        if other is not None:
            result = other
            done.add(command.thing)
    return result if done else None


def _switch_one(take: ComposedTake, number: int, pool: Pool, seeds: Array) -> ComposedTake | None:
    """The take with another object for command ``number``; None where none that the ``seeds`` draw fits."""
    thing = take.things[take.commands[number].thing]
    e = embed(take.hips, take.rotations, _contacts(take, thing), thing.furniture, thing.poses)
    active = _active(take, number, e)
    if not active.any():
        return None
    span = _Span(take, number, e, active)
    for seed, share in zip(seeds, SHARES, strict=True):
        piece = _nearer(switch(pool, thing.furniture.kind, int(seed)), thing.furniture, share)
        seat = piece.seat
        if seat is not None and (
            seat.arms != thing.furniture.require_seat().arms
            or not SEATS_SWAPPED[0] <= seat.height <= SEATS_SWAPPED[1]
        ):
            continue
        other = Thing(piece, _stand(thing, piece))
        if not span.room(other):
            continue
        try:
            hips, rotations = transfer(e.cut(span.frames), piece, other.poses)
        except GeometryError:
            continue
        if span.sound(hips, rotations, other):
            return span.with_motion(hips, rotations, other)
    return None


def _nearer(piece: Furniture, old: Furniture, share: float) -> Furniture:
    """A piece with only a ``share`` of its difference in size from another; a seat in its height alone.

    Feet before and behind an object leave its depth little room: it comes near sooner.
    """
    if piece.seat is not None:
        new, before = piece.seat.height, old.require_seat().height
        factors: Array = np.array((1, 1, (before + share * (new - before)) / new))
    else:
        factors = (old.size + np.array((share, share**3, share)) * (piece.size - old.size)) / piece.size
    return scaled(piece, factors)


def _stand(thing: Thing, piece: Furniture) -> Array:
    """Pose (4,) of a piece in a thing's place: as ``align`` has it, but with a seat's edge not nearer to the
    calves.
    """
    pose = align(thing.furniture, thing.poses, piece)
    if piece.seat is not None:
        edge, before = (
            float(f.require_seat().point[1] - f.mins[:, 1].min()) for f in (piece, thing.furniture)
        )
        pose[:2] -= np.clip(edge - before, 0, MOST_BACK) * heading_to_direction(
            np.float64(pose[3] + piece.seat.heading)
        )
    return pose


def _contacts(take: ComposedTake, thing: Thing) -> Array:
    """Contacts (T, 5) of a take, with the hands that rest on the arms of a seat."""
    contacts = np.array(take.contacts)
    rests = arm_rests(thing.furniture)
    if all(rest is None for rest in rests):
        return contacts
    joints = forward_kinematics(take.hips, take.rotations)[0]
    for side, rest in enumerate(rests):
        if rest is not None:
            at = rotate_planar(rest.astype(np.float64), np.float64(thing.poses[3])) + thing.poses[:3]
            on = np.linalg.norm(joints[:, ARMS[side][2]] - at, axis=1) < _ON_REST
            contacts[on & (take.labels[:, SIT] > 0), HAND_CONTACTS[side]] = 1
    return contacts


def _active(take: ComposedTake, number: int, e: Embedded) -> Array:
    """Frames (T,) in which the object of command ``number`` is used: it is touched, or the label of its
    action is on.
    """
    command, count = take.commands[number], np.arange(len(take))
    later = [c.frame for c in take.commands[number + 1 :] if c.thing >= 0 and c.thing != command.thing]
    # The label of what was done before may still fade when this is asked for, and its own when the next thing
    # is.
    used = e.touch.any(axis=1)
    for first, last in intervals(take.labels[:, _LABELS[command.action]] > 0):
        used[first:last] |= command.frame <= first < min(later, default=len(take))
    if not used.any():
        return used
    first, last = np.flatnonzero(used)[[0, -1]]
    return (count >= first) & (count <= last)


def _rectangle(furniture: Furniture, pose: Array) -> tuple[Array, Array, Array]:
    """Corners (4, 2) of the footprint in the world, its two axes (2, 2), and bottom and top (2,)."""
    lo, hi = furniture.mins.min(0).astype(np.float64), furniture.maxs.max(0).astype(np.float64)
    corners = np.array([(x, y) for x in (lo[0], hi[0]) for y in (lo[1], hi[1])])
    axes = rotate_planar(np.eye(2), np.full(2, pose[3]))
    return rotate_planar(corners, np.full(4, pose[3])) + pose[:2], axes, np.array((lo[2], hi[2])) + pose[2]


def _overlap(a: tuple[Array, Array, Array], b: tuple[Array, Array, Array]) -> bool:
    """Whether two upright boxes, as ``_rectangle`` gives them, share any room: no side of either separates
    them.
    """
    if a[2][0] >= b[2][1] or b[2][0] >= a[2][1]:
        return False
    axes = np.concatenate((a[1], b[1]))
    one, two = a[0] @ axes.T, b[0] @ axes.T
    return bool(((one.max(0) > two.min(0)) & (two.max(0) > one.min(0))).all())


class _Span:
    """The frames about an interaction, what the body may do in them, and what is about it."""

    def __init__(self, take: ComposedTake, number: int, e: Embedded, active: Array) -> None:
        """``active`` (T,) tells in which frames the object of command ``number`` is used."""
        self.take, self.number, self.e, self.active = take, number, e, active
        used = np.flatnonzero(active)
        self.frames = slice(max(int(used[0]) - AROUND, 0), min(int(used[-1]) + AROUND + 1, len(take)))
        index = take.commands[number].thing
        self.thing = take.things[index]
        middle = int(used.mean())
        others = [t for n, t in enumerate(take.things) if n != index]
        poses = [(o.furniture, np.array((*o.position, 0.0, o.heading))) for o in take.obstacles]
        self.rest = cuboids(
            [
                (f, p[:3], float(p[3]))
                for f, p in poses + [(t.furniture, t.track(len(take))[middle]) for t in others]
            ]
        )
        poses += [
            (t.furniture, p)
            for t in others
            for p in (np.unique(t.poses[::6], axis=0) if t.moves else t.poses[None])
        ]
        self.rectangles = [_rectangle(f, p) for f, p in poses]
        body, radii = thin_spheres(take.hips[::2], take.rotations[::2])
        at = np.arange(len(take))[::2]
        outside = (at < self.frames.start) | (at >= self.frames.stop)
        self.elsewhere = body[outside], radii
        self.joints = forward_kinematics(take.hips.astype(np.float64), take.rotations.astype(np.float64))[0]
        self.allowed = [
            depth_in_solids((body, radii), solid) + DEEPER for solid in (_solid(self.thing), self.rest)
        ]

    def room(self, other: Thing) -> bool:
        """Whether another object overlaps nothing and keeps off the way of the body where it is not used."""
        mine = _rectangle(other.furniture, other.poses)
        if any(_overlap(mine, r) for r in self.rectangles):
            return False
        hips = self.joints[~self.active, HIPS, :2]
        before, after = (_away(t, hips) for t in (self.thing, other))
        if ((after < KEEP_OFF) & (after < before - 0.02)).any():
            return False
        return depth_in_solids(self.elsewhere, _solid(other)) <= self.allowed[0]

    def sound(self, hips: Array, rotations: Array, other: Thing) -> bool:
        """Whether the motion of the span on another object is as sound as it was on its own."""
        joints = self.joints.copy()
        joints[self.frames] = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))[0]
        around = slice(max(self.frames.start - 3, 0), self.frames.stop + 3)
        if not no_faster(joints[around], self.joints[around]):
            return False
        return (
            self._feet_stand(joints, other)
            and self._hips_rest(joints, other)
            and self._not_deeper(hips, rotations, other)
        )

    def _not_deeper(self, hips: Array, rotations: Array, other: Thing) -> bool:
        body = thin_spheres(hips, rotations)  # every frame: feet swing over edges within two
        return all(
            depth_in_solids(body, s) <= a
            for s, a in zip((_solid(other), self.rest), self.allowed, strict=True)
        )

    def _hips_rest(self, joints: Array, other: Thing) -> bool:
        """Whether the hips of a sitter come to their place on the seat's height."""
        seat, on = other.furniture.seat, self.e.touch[:, HIP_CONTACT]
        if seat is None or not on.any():
            return seat is None
        return abs(float(joints[on, HIPS, 2].mean()) - seat.height - HIP_OVER_SEAT) < ASTRAY

    def _feet_stand(self, joints: Array, other: Thing) -> bool:
        """Whether feet stay where they stand, rest on the object, and do not stick out over its edges."""
        before, after = self.joints[:, _TOES], joints[:, _TOES]
        if np.linalg.norm(after - before, axis=-1)[self.e.floor].max(initial=0) > ASTRAY:
            return False
        on = np.asarray(self.take.contacts)[:, FOOT_CONTACTS] > 0.5
        slow, fast = (
            np.linalg.norm(np.gradient(t, axis=0), axis=-1)[on].max(initial=0) * FPS for t in (before, after)
        )
        if fast > max(slow, RESTING):
            return False
        top = self.e.touch[:, FOOT_CONTACTS]
        if not top.any():
            return True
        out = [_away(t, p[top][:, :2]).max() for t, p in ((self.thing, before), (other, after))]
        return out[1] <= max(out[0], FOOT_OVER_EDGE)

    def with_motion(self, hips: Array, rotations: Array, other: Thing) -> ComposedTake:
        """The take with another object, the motion of the span on it, and its goal moved along."""
        take = self.take
        new_hips, new_rotations = take.hips.copy(), take.rotations.copy()
        new_hips[self.frames], new_rotations[self.frames] = hips, rotations
        things, commands = list(take.things), list(take.commands)
        command = commands[self.number]
        things[command.thing] = other
        commands[self.number] = replace(command, position=self._goal(command, new_hips, other))
        return replace(take, hips=new_hips, rotations=new_rotations, things=things, commands=commands)

    def _goal(self, command: TimedCommand, hips: Array, other: Thing) -> Array:
        """Where the command now asks the body to be, (3,): moved as the hips are while they are there."""
        asked = command.position
        assert asked is not None  # who uses an object is sent to a place
        if command.action == "sit":
            there: Array | slice = self.e.touch[:, HIP_CONTACT]
        else:
            used = np.flatnonzero(self.active)
            nearest = used[np.linalg.norm(self.take.hips[used, :2] - asked[:2], axis=1).argmin()]
            there = slice(nearest, nearest + 1)
        goal = asked + (hips[there] - self.take.hips[there]).mean(axis=0)
        if command.action != "sit":
            goal[2] = other.furniture.maxs[:, 2].max() if asked[2] > 0 else 0.0
        return goal.astype(np.float32)


def _away(thing: Thing, points: Array) -> Array:
    """Metres (N,) from floor points (N, 2) to the footprint of a thing that stands."""
    lo, hi = thing.furniture.mins[:, :2].min(0), thing.furniture.maxs[:, :2].max(0)
    local = rotate_planar(points - thing.poses[:2], np.full(len(points), -thing.poses[3]))
    return np.linalg.norm(np.maximum(np.maximum(lo - local, local - hi), 0), axis=-1)


def _solid(thing: Thing) -> Cuboids:
    return cuboids([(thing.furniture, thing.poses[:3], float(thing.poses[3]))])
