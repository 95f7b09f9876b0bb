"""Meshes as the scene shows them: with modifiers, instances, parents and scales, as world-space triangles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array


@dataclass(frozen=True)
class Shape:
    """One mesh in the world: ``vertices`` (V, 3) float64, Blender units, and ``triangles`` (F, 3) int64, outward as modelled.

    ``owner`` is the object in the scene it belongs to: itself, or the one that makes the instance.
    """

    owner: bpy.types.Object
    vertices: Array
    triangles: Array


def evaluated_shapes(depsgraph: bpy.types.Depsgraph, owners: Iterable[bpy.types.Object] | None = None) -> Iterator[Shape]:
    """Yield every visible surface of the evaluated scene, of all objects or of ``owners`` alone.

    Instances of collections, vertices, particles and geometry nodes come once each, with the object that makes them as
    owner.  Raises GeometryError on coordinates that are not finite.
    """
    wanted = None if owners is None else {o.name_full for o in owners}
    for instance in depsgraph.object_instances:
        shown = instance.object
        if shown.type != "MESH":  # curves, texts and metaballs come a second time, as the mesh they make
            continue
        owner = (instance.parent if instance.is_instance else shown).original
        if wanted is not None and owner.name_full not in wanted:
            continue
        shape = _shape(owner, shown, np.array(instance.matrix_world, dtype=np.float64))
        if shape is not None:
            yield shape


def _shape(owner: bpy.types.Object, shown: bpy.types.Object, matrix: Array) -> Shape | None:
    """Triangles of one evaluated object at a world matrix (4, 4), or None where it has no faces."""
    mesh = shown.data
    mesh.calc_loop_triangles()
    if not len(mesh.loop_triangles):
        return None
    vertices = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", vertices)
    triangles = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    triangles = triangles.reshape(-1, 3).astype(np.int64)
    with np.errstate(invalid="ignore", over="ignore"):
        world = vertices.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    if not np.isfinite(world[triangles]).all():
        raise GeometryError(f"{owner.name} has coordinates that are not numbers; delete these vertices or repair its scale.")
    # Vertices without faces may be anything; they must not upset bounding boxes.
    used, triangles = np.unique(triangles, return_inverse=True)
    world, triangles = world[used], triangles.reshape(-1, 3)
    if np.linalg.det(matrix[:3, :3]) < 0:
        triangles = triangles[:, ::-1]
    return Shape(owner, world, np.ascontiguousarray(triangles))


def object_mesh_triangles(target: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> tuple[Array, Array]:
    """World vertices (V, 3), Blender units, and triangles (F, 3) of an object, its instances and its children.

    Children that a character's armature deforms are left out.  Raises GeometryError when there are no faces.
    """
    family = [o for o in (target, *target.children_recursive) if o is target or not _worn(o)]
    shapes = list(evaluated_shapes(depsgraph, family))
    if not shapes:
        raise GeometryError(
            f"{target.name} has no visible faces to sense; choose an object with a mesh, show it in the viewport, or add faces to it."
        )
    return join(shapes)


def join(shapes: list[Shape]) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (F, 3) of several shapes as one mesh."""
    if not shapes:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    starts = np.cumsum([0] + [len(s.vertices) for s in shapes[:-1]])
    return np.concatenate([s.vertices for s in shapes]), np.concatenate([s.triangles + i for s, i in zip(shapes, starts, strict=True)])


def _worn(candidate: bpy.types.Object) -> bool:
    """Whether an object is part of a character: an armature, or deformed or carried by one."""
    ancestor = candidate
    while ancestor is not None:
        if ancestor.type == "ARMATURE":
            return True
        ancestor = ancestor.parent
    return any(m.type == "ARMATURE" and m.object is not None for m in candidate.modifiers)
