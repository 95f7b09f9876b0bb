"""What is solid in the scene as it is now, read in one go; a take reads it in slices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy

from nsm_blender.world.bvh_query import BVHQuery
from nsm_blender.world.colliders import obstacles, query_of, scene_solids, solid_seen
from nsm_blender.world.evaluated import Snapshot
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.solids import Solid


def gather_colliders(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    exclude: Iterable[bpy.types.Object] = (),
    frame: WorldFrame = WorldFrame(),  # noqa: B008
) -> BVHQuery:
    """The query over everything solid in the scene as evaluated now, in the core's ``frame``."""
    if depsgraph is None:
        depsgraph = bpy.context.evaluated_depsgraph_get()
    return query_of(collider_shapes(scene, depsgraph, list(exclude), frame))


def collider_shapes(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    exclude: Sequence[bpy.types.Object] = (),
    frame: WorldFrame = WorldFrame(),  # noqa: B008
) -> list[Solid]:
    """Meshes of the scene that characters collide with, in the core's ``frame``."""
    return obstacles(scene_solids(solid_seen(Snapshot.now(depsgraph), scene, exclude), frame))
