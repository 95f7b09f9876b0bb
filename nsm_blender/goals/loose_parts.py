"""Furniture in loose parts: legs, seat, back and cushions that are objects of their own are one thing to sit
on.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.world.affordances.seat import find_seat

from ..world.bodies import GoalBody
from ..world.evaluated import Snapshot, family_of
from ..world.frame import WorldFrame
from ..world.solids import Solid, solids_of
from ..world.surroundings import Surroundings

_TOUCH = 0.02  # metres between parts that hold together
_LARGEST = 3.5  # metres: what is larger is a room, a wall or a stage
# Share of a part's footprint that lies on its thing, which may stick out so many metres less.
_WITHIN, _OVERHANG = 0.7, 0.08
_WIDER = 1.6  # how much wider than a thing is what it stands on
_CUSHION = 0.15  # metres by which what lies on a seat may raise it; what is higher stands on it
_MOST = 1500  # corners of a part that are looked at


def is_group(candidate: bpy.types.Object) -> bool:
    """Whether an empty holds meshes: it is a thing then, and no place."""
    return candidate.instance_type == "COLLECTION" or any(
        c.type == "MESH" for c in candidate.children_recursive
    )


def seat_body(target: bpy.types.Object, around: Surroundings) -> GoalBody:
    """The mesh of a thing to sit on or to walk up to, with the loose parts that belong to it; GeometryError
    where it has none.
    """
    alone = around.body(target)
    parts = loose_parts(target, around)
    if not parts:
        return alone
    whole = alone.joined(parts)
    own, joint = (_seat_height(body) for body in (alone, whole))
    # A box that stands on a chair makes no higher chair.
    return alone if own is not None and (joint is None or abs(joint - own) > _CUSHION) else whole


def loose_parts(target: bpy.types.Object, around: Surroundings) -> list[Solid]:
    """What touches a thing and lies over, under or on it, part by part; rooms, floors and neighbours do not
    belong to it.
    """
    own = {o.name_full for o in family_of(target)}
    solids: dict[str, list[Solid]] = {}
    for solid in around.standing:
        solids.setdefault(solid.owner, []).append(solid)
    things = {name: _Thing(parts) for name, parts in solids.items()}
    members = [things.pop(name) for name in own if name in things]
    first = len(members)
    for member in members:  # grows while it is gone through
        low, high = np.min([m.low for m in members], 0), np.max([m.high for m in members], 0)
        for name, other in list(things.items()):
            if other.belongs_to(low, high, member) and member.touches(other):
                members.append(things.pop(name))
    return [solid for m in members[first:] for solid in m.solids]


def touch(one: bpy.types.Object, other: bpy.types.Object, frame: WorldFrame) -> bool:
    """Whether two objects are parts of one thing: the second touches the first, and lies over, under or
    on it.
    """
    pair = [solids_of(Snapshot.of_objects(family_of(o)).seen, frame) for o in (one, other)]
    if not all(pair):
        return False
    first, second = (_Thing(solids) for solids in pair)
    return second.belongs_to(first.low, first.high, first) and first.touches(second)


class _Thing:
    """One object's solids, and the box around them."""

    def __init__(self, solids: list[Solid]) -> None:
        self.solids = solids
        self.low, self.high = (
            np.min([s.bounds[0] for s in solids], 0),
            np.max([s.bounds[1] for s in solids], 0),
        )
        self._trees: list[BVHTree] | None = None

    @property
    def trees(self) -> list[BVHTree]:
        if self._trees is None:
            self._trees = [
                BVHTree.FromPolygons(s.vertices.tolist(), s.triangles.tolist(), all_triangles=True)
                for s in self.solids
            ]
        return self._trees

    def belongs_to(self, low: Array, high: Array, member: _Thing) -> bool:
        """Whether it lies over, under or on a thing between two corners (3,), of which ``member`` is the part
        next to it.
        """
        apart = (self.low > member.high + _TOUCH).any() or (self.high < member.low - _TOUCH).any()
        if apart or (self.high - self.low)[:2].max() > _LARGEST:
            return False
        if _share(self, low - _OVERHANG, high + _OVERHANG) >= _WITHIN:
            return True
        # What a thing stands on is no part of it, but a back stands on a seat of its own width.
        beneath = (
            self.high[2] <= member.low[2] + _TOUCH
            and np.ptp((self.low, self.high), 0)[:2].max() > _WIDER * (high - low)[:2].max()
        )
        return not beneath and _share(member, self.low - _OVERHANG, self.high + _OVERHANG) >= _WITHIN

    def touches(self, other: _Thing) -> bool:
        """Whether some of their faces are nearer than ``_TOUCH`` metres."""
        for a, b in ((self, other), (other, self)):
            for solid in a.solids:
                near = solid.vertices[
                    ((solid.vertices >= b.low - _TOUCH) & (solid.vertices <= b.high + _TOUCH)).all(1)
                ]
                for place in near[:: max(1, len(near) // _MOST)].tolist():
                    if any(tree.find_nearest(place, _TOUCH)[0] is not None for tree in b.trees):
                        return True
        return any(a.overlap(b) for a in self.trees for b in other.trees)


def _share(part: _Thing, low: Array, high: Array) -> float:
    """Share of a part's footprint that lies between two corners."""
    size = np.maximum((part.high - part.low)[:2], 1e-3)
    common = np.minimum(part.high, high)[:2] - np.maximum(part.low, low)[:2]
    return float(np.prod(np.maximum(common, 0) / size)) if (common > -1e-3).all() else 0.0


def _seat_height(body: GoalBody) -> float | None:
    try:
        return float(find_seat(body.vertices, body.triangles).point[2])
    except GeometryError:
        return None
