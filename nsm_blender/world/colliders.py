"""What is solid in a Blender scene, as a distance query over its evaluated meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import bpy

from .bvh_query import BVHQuery
from .evaluated import Seen, Snapshot
from .frame import WorldFrame
from .ground import is_ground
from .solids import Solid, is_litter, placed, solids_of


def scene_solids(
    seen: Sequence[Seen], frame: WorldFrame, said: Callable[[float], None] = lambda _: None
) -> list[Solid]:
    """Read what is seen as solid, in the core's ``frame``, without copies as small as grass and pebbles but
    with what is walked over; ``said`` hears how far that is, 0..1.
    """
    made = zip(seen, solids_of(seen, frame, said), strict=True)
    return [solid for s, solid in made if not (s.instance and not s.said and is_litter(solid))]


def obstacles(solids: Iterable[Solid]) -> list[Solid]:
    """Those that are not walked over."""
    return [s for s in solids if not is_ground(s)]


def solid_seen(snapshot: Snapshot, scene: bpy.types.Scene, exclude: Iterable[bpy.types.Object]) -> list[Seen]:
    """What of a snapshot characters collide with: what looks solid in the viewport.

    Left out: ``exclude`` and whatever is parented to or deformed by one of it; what is hidden in the
    viewport, shown as wire or bounds, or has materials without a surface, as fog has.  What is only hidden in
    renders, or from the camera, or held out is solid, as it is seen.  The custom property "nsm_collider" on
    an object wins over looks: switched off it is no collider, switched on it is one, even hidden.
    """
    left_out = belonging_to(scene, exclude)
    return [
        s for s in snapshot.seen if s.owner not in left_out and (s.looks_solid if s.said is None else s.said)
    ]


def belonging_to(scene: bpy.types.Scene, owners: Iterable[bpy.types.Object]) -> set[str]:
    """Full names of some objects and of all that hang on one of them or are deformed by one."""
    names = {o.name_full for o in owners}
    return {o.name_full for o in scene.objects if _belongs_to(o, names)} if names else names


def query_of(solids: Sequence[Solid]) -> BVHQuery:
    """The query over what is solid above the floor, which the faces of room-sized meshes at its height are;
    without any it finds nothing.  The one made last for the same solids is given again.
    """
    global _last
    key, names = placed(solids), [s.owner for s in solids]
    last = _last
    if last is None or last[0] != (key, names):
        # The query holds its readings, so that none of their numbers is given to another one while it is
        # kept.
        last = _last = (key, names), BVHQuery(solids, floor=True)
    return last[1]


_last: tuple[tuple[bytes, list[str]], BVHQuery] | None = None


def forget() -> None:
    """Keep no query."""
    global _last
    _last = None


def _belongs_to(candidate: bpy.types.Object, owners: set[str]) -> bool:
    """Whether an object is one of ``owners``, hangs on one, or is deformed by one."""
    if any(
        m.type == "ARMATURE" and m.object is not None and m.object.name_full in owners
        for m in candidate.modifiers
    ):
        return True
    ancestor: bpy.types.Object | None = candidate
    while ancestor is not None:
        if ancestor.name_full in owners:
            return True
        ancestor = ancestor.parent
    return False
