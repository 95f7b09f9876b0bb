"""Where a light thing is while it is carried: before the body, further aside where the other hand works."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import (
    Array,
    direction_to_heading,
    heading_to_direction,
    rotate_planar,
    wrap_angle,
)
from nsm_core.world.affordances.picking import Picking, Visit
from nsm_core.world.affordances.reach import LEFT, RIGHT
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.hand_way import filled, paced
from nsm_core.world.scene.props import LightThing

FASTEST, LADEN = 1.0, 0.8  # m/s of an empty hand and of one that holds something, at most
TAKING_UP = 24  # frames in which what was elsewhere comes before the body, or onto its way
# Metres of a wrist with a thing from the root, aside where either hand has one, and over the floor.
BEFORE, BESIDE, WIDE, HIGH = 0.34, 0.16, 0.2, 1.04
OVER = 0.96  # metres over the floor of a thing's foot at least: worktops pass under it
NEARER = (0.0, 0.06, 0.12)  # metres by which it is held nearer where something stands there
INWARD = np.radians(25)  # by which such a hand points across the body
KEEPS = 0.06  # metres that what is carried keeps off what stands about
# Metres by which it is raised over that, and of room that it may lose on its way up.
OVER_THAT, UNDER = (0.0, 0.06, 0.12, 0.18, 0.24), 0.02
APART = 0.13  # metres between wrists at work at the same moment


def carried(picking: Picking, aside: float = BESIDE, inward: float = INWARD, near: float = 0.0) -> Array:
    """Pose (4,) of a thing that is carried, seen from the root of a body that faces heading 0: its wrist so
    many metres ``aside`` and pointing ``inward``, ``near`` metres nearer than else.
    """
    side = (RIGHT, LEFT)[picking.hand]
    ahead = heading_to_direction(np.array(0.0))
    rotation = picking.grasp.wrist.rotation
    way = -rotation[:, 1] if abs(rotation[2, 1]) < 0.8 else rotation[:, 2]
    turn = float(direction_to_heading(ahead)) - side * inward - float(direction_to_heading(way[:2]))
    held = picking.wrist(np.array((0.0, 0.0, 0.0, turn))).place
    place = (BEFORE - near) * ahead + side * aside * np.array((1.0, 0.0))
    place = np.append(place, max(HIGH, OVER + held[2]))
    return np.append(place - held, wrap_angle(turn))


def held_aside(picking: Picking, thing: LightThing, solids: DistanceQuery) -> Array | None:
    """The same (4,) while the other hand works, as near to the body as takes it out of ``solids`` where the
    thing was taken and where it will be put down; None where there is no room beside the body.
    """
    for near in NEARER:
        held = carried(picking, WIDE, 0.0, near)
        if all(_has_room(thing, held, visit, solids) for visit in (picking.pick, picking.put)):
            return held
    return None


def _has_room(thing: LightThing, held: Array, visit: Visit, solids: DistanceQuery) -> bool:
    balls = filled(thing.put(in_world(held, np.append(visit.reach.place, visit.reach.heading))))
    places = np.stack([place for place, _ in balls]).astype(np.float32)
    return bool((solids.signed_distance(places, 0.5) > np.array([radius for _, radius in balls])).all())


def in_world(held: Array, root: Array) -> Array:
    """The pose (4,) of a thing ``held`` (4,) as seen from a ``root`` (3,) at heading 0."""
    place = rotate_planar(held[:3], np.float64(root[2])) + (root[0], root[1], 0.0)
    return np.append(place, held[3] + root[2])


def over(thing: LightThing, solids: DistanceQuery) -> float:
    """Metres by which a thing is carried higher than where it is, for the ``solids`` that stand about: as
    few as give it room, none where it has no more room higher up or something is over it.
    """
    places, radii = (np.array(one) for one in zip(*filled(thing), strict=True))
    raised = places + np.array(OVER_THAT)[:, None, None] * (0.0, 0.0, 1.0)
    need = radii + KEEPS
    far = solids.signed_distance(raised.reshape(-1, 3).astype(np.float32), float(need.max()))
    lack = (need - far.reshape(len(raised), -1)).max(1)
    free = np.flatnonzero(lack <= 0)
    if len(free) and (lack[: free[0]] < lack[0] + UNDER).all():
        return OVER_THAT[int(free[0])]
    return 0.0


def beside(visit: Visit, pose: Array) -> Array:
    """Pose (4,) of a thing, seen from a body that stands for a visit, with the hand where its ways begin; it
    stands at ``pose`` (4,) where they end.
    """
    reach = visit.reach
    off = pose[:3] + visit.laden[0] - visit.wrist.place - (*reach.place, 0.0)
    return np.append(rotate_planar(off, np.float64(-reach.heading)), wrap_angle(pose[3] - reach.heading))


def hands_apart(one: Visit, other: Visit) -> bool:
    """Whether two hands that work at the same moment keep off each other on their ways."""
    for name, speed in (("empty", FASTEST), ("laden", LADEN)):
        ways = [paced(getattr(visit, name), speed, TAKING_UP) for visit in (one, other)]
        count = max(map(len, ways))
        # They set out together to what they take, and together from there.
        if name == "empty":
            ways = [np.concatenate((way, np.repeat(way[-1:], count - len(way), 0))) for way in ways]
        else:
            ways = [np.concatenate((way[::-1], np.repeat(way[:1], count - len(way), 0))) for way in ways]
        if np.linalg.norm(ways[0] - ways[1], axis=1).min() < APART:
            return False
    return True


__all__ = ["beside", "carried", "hands_apart", "held_aside", "in_world", "over"]
