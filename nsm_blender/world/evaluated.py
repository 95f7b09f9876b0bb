"""Meshes as the scene shows them: with modifiers, instances, parents and scales."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from mathutils.geometry import tessellate_polygon

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.world.geometry.mesh_reading import digest

_SLICE = 0.015  # seconds of reading between two looks at the window
_DENSE = 30_000  # faces' corners from which Blender's own triangles, read one by one, take too long


class MeshData:
    """The faces of one evaluated mesh, copied out of Blender in its own frame, so that any thread may work on
    them.
    """

    def __init__(self, mesh: bpy.types.Mesh) -> None:
        self._vertices = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        # Attributes are copied whole; ``vertices`` and ``loops`` give them number by number, 30 times slower.
        if len(mesh.vertices):
            mesh.attributes["position"].data.foreach_get("vector", self._vertices.reshape(-1))
        self._corners = np.zeros(0, np.int32)
        self._starts = self._made = None
        if len(mesh.loops) <= _DENSE:
            mesh.calc_loop_triangles()
            made = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
            mesh.loop_triangles.foreach_get("vertices", made)
            self._made = made.reshape(-1, 3)
            return
        self._corners = np.empty(len(mesh.loops), dtype=np.int32)
        mesh.attributes[".corner_vert"].data.foreach_get("value", self._corners)
        self._starts = _starts(mesh)

    @property
    def corners(self) -> int:
        """How many corners its faces have."""
        return 3 * len(self._made) if self._made is not None else len(self._corners)

    @property
    def empty(self) -> bool:
        """Whether there are no faces."""
        return self._made is not None and not len(self._made)

    @cached_property
    def digest(self) -> bytes:
        """What the mesh holds, as a short name: that of an edited mesh is another."""
        return digest(
            self._vertices, self._corners, *(a for a in (self._starts, self._made) if a is not None)
        )

    @cached_property
    def faces(self) -> tuple[Array, Array]:
        """Vertices (V, 3) float32, those that faces use, and triangles (F, 3) int64."""
        triangles = (self._made if self._made is not None else self._triangulated()).astype(np.int64)
        used = np.zeros(len(self._vertices), dtype=bool)
        used[triangles] = True
        # Vertices without faces may be anything; they must not upset bounding boxes.
        if used.all():
            return self._vertices, triangles
        return self._vertices[used], (np.cumsum(used) - 1)[triangles]

    def _triangulated(self) -> Array:
        """Triangles (F, 3) of the faces: quads along the diagonal that does not fold them, larger ones as
        fans where they are convex.
        """
        size = np.diff(np.append(self._starts, len(self._corners)))
        threes, fours = self._starts[size == 3], self._starts[size == 4]
        parts = [self._corners[threes[:, None] + np.arange(3)]]
        quads = self._corners[fours[:, None] + np.arange(4)]
        a, b, c, d = (self._vertices[quads[:, k]] for k in range(4))
        with np.errstate(invalid="ignore", over="ignore"):
            folded = (np.cross(b - a, c - a) * np.cross(c - a, d - a)).sum(1) < 0
        quads[folded] = np.roll(quads[folded], -1, axis=1)
        parts += [quads[:, (0, 1, 2)], quads[:, (0, 2, 3)]]
        for n in np.unique(size[size > 4]):
            faces = self._corners[self._starts[size == n][:, None] + np.arange(n)]
            at = self._vertices[faces]
            side = np.cross(np.roll(at, -1, 1) - at, at - np.roll(at, 1, 1))
            convex = ((side * side.sum(1, keepdims=True)).sum(-1) >= 0).all(1)
            fan = np.stack((np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)), 1)
            parts.append(faces[convex][:, fan].reshape(-1, 3))
            for face in faces[~convex]:
                cut = np.array(tessellate_polygon([self._vertices[face].tolist()]), dtype=np.int64).reshape(
                    -1, 3
                )
                parts.append(face[cut])
        return np.concatenate(parts)


def _starts(mesh: bpy.types.Mesh) -> Array:
    """First corners (P,) of the faces; where all seem to have three or four corners a look at some saves
    asking for each.
    """
    count, corners = len(mesh.polygons), len(mesh.loops)
    for n in (3, 4):
        looked_at = {*range(0, count, max(1, count // 500)), count - 1}
        if n * count == corners and all(mesh.polygons[i].loop_start == n * i for i in looked_at):
            return np.arange(0, corners, n)
    starts = np.empty(count, dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    return starts.astype(np.int64)


@dataclass(frozen=True)
class Seen:
    """One mesh where it is shown: ``matrix`` (4, 4) to the world; ``owner`` the full name of the object that
    it belongs to.

    ``instance``: one of many copies that its owner makes.  ``solid``: whether it looks solid, and whether the
    animator has said that it is one (True), or that it is none (False).
    """

    owner: str
    mesh: MeshData
    matrix: Array
    instance: bool
    looks_solid: bool
    said: bool | None


# On an object: True where characters collide with it whatever it looks like, False where not.
COLLIDER_PROPERTY = "nsm_collider"


class Snapshot:
    """Every mesh that the scene shows at one moment, each copied once however often it is shown."""

    def __init__(self) -> None:
        self.seen: list[Seen] = []
        self._begun = -1  # the instance whose mesh Blender had to make first, which took a slice of its own

    @classmethod
    def take(cls, evaluated: Callable[[], bpy.types.Depsgraph]) -> Generator[float, None, Snapshot]:
        """Copy the meshes in slices; ``evaluated`` gives the scene's depsgraph as of the moment, and is asked
        anew in each.  Yields 0 after every slice: nobody knows how many there will be.

        Instances of collections, vertices, particles and geometry nodes come once each, with the object that
        makes them as owner; so do hidden meshes that are marked as colliders.
        """
        made, known, done = cls(), {}, 0
        while done is not None:
            done = made._slice(evaluated(), known, done)
            yield 0.0
        return made

    @classmethod
    def now(cls, depsgraph: bpy.types.Depsgraph) -> Snapshot:
        """The same in one go."""
        steps = cls.take(lambda: depsgraph)
        while True:
            try:
                next(steps)
            except StopIteration as stop:
                return stop.value

    @classmethod
    def of_objects(cls, objects: Iterable[bpy.types.Object]) -> Snapshot:
        """These mesh objects alone, as they are shown now."""
        made, known, depsgraph = cls(), {}, bpy.context.evaluated_depsgraph_get()
        for target in objects:
            shown = target.evaluated_get(depsgraph)
            if shown.type == "MESH":
                made._add(target, shown, shown.matrix_world, False, known)
        return made

    def _slice(
        self, depsgraph: bpy.types.Depsgraph, known: dict[tuple[int, ...], Any], done: int
    ) -> int | None:
        """Copy what comes after the first ``done`` instances; how many are done now, None when all are."""
        instances, stopped = iter(depsgraph.object_instances), None
        deque(islice(instances, done), maxlen=0)
        # Going through thousands takes some of these milliseconds itself: begun once there.
        until = time.perf_counter() + _SLICE
        for index, instance in enumerate(instances, done + 1):
            shown = instance.object
            if shown.type == "MESH":  # curves, texts and metaballs come a second time, as the mesh they make
                asked = time.perf_counter()
                shown.data  # noqa: B018  Blender subdivides a mesh when it is first asked for, in one go
                if time.perf_counter() - asked > _SLICE / 3 and self._begun != index:
                    self._begun, stopped = index, index - 1  # it is copied in the next slice
                    break
                self._add(
                    instance.parent if instance.is_instance else shown,
                    shown,
                    instance.matrix_world,
                    instance.is_instance,
                    known,
                )
            if time.perf_counter() > until:
                stopped = index
                break
        # Blender loses the memory of instances that are not gone through to the end.
        deque(instances, maxlen=0)
        if stopped is not None:
            return stopped
        for hidden in depsgraph.scene.objects:
            if (
                hidden.type == "MESH"
                and hidden.get(COLLIDER_PROPERTY)
                and not hidden.visible_get(view_layer=depsgraph.view_layer)
            ):
                self._add(hidden, hidden, hidden.matrix_world, False, known)
        return None

    def _add(
        self,
        maker: bpy.types.Object,
        shown: bpy.types.Object,
        matrix: Matrix,
        instance: bool,
        known: dict[tuple[int, ...], Any],
    ) -> None:
        mesh = shown.data
        key = (mesh.as_pointer(), len(mesh.vertices), len(mesh.loops))
        # An object shows a mesh thousands of times: what the two are is asked once.  Of instances ``shown``
        # is a passing copy.
        pair = (*key, maker.as_pointer(), shown.original.as_pointer())
        if pair not in known:
            if key not in known:
                known[key] = MeshData(mesh), not _is_volume(mesh)
            known[pair] = None if known[key][0].empty else _looks(maker.original, shown, *known[key])
        if known[pair] is not None:
            owner, data, solid, said = known[pair]
            # Of the matrix as it is numpy makes it 14 times slower.
            place = np.array([x for row in matrix for x in row]).reshape(4, 4)
            self.seen.append(Seen(owner, data, place, instance, solid, said))

    def of(self, owners: Iterable[str]) -> list[Seen]:
        """What belongs to objects of these full names."""
        wanted = set(owners)
        return [s for s in self.seen if s.owner in wanted]


def _looks(
    owner: bpy.types.Object, shown: bpy.types.Object, data: MeshData, dense: bool
) -> tuple[str, MeshData, bool, bool | None]:
    """Of an object that shows a mesh: the owner's full name, the mesh, whether it looks solid, and what the
    animator says of it.
    """
    said = shown.get(COLLIDER_PROPERTY, owner.get(COLLIDER_PROPERTY))
    outlined = {shown.display_type, owner.display_type} & {"WIRE", "BOUNDS"}
    return owner.name_full, data, dense and not outlined, None if said is None else bool(said)


def _is_volume(mesh: bpy.types.Mesh) -> bool:
    """Whether all of a mesh's materials are smoke or fog without a surface."""
    return len(mesh.materials) > 0 and all(m is not None and _without_surface(m) for m in mesh.materials)


def _without_surface(material: bpy.types.Material) -> bool:
    tree = material.node_tree
    if tree is None:
        return False
    outputs = [n for n in tree.nodes if n.type == "OUTPUT_MATERIAL"]
    output = next((n for n in outputs if n.is_active_output), None)
    return output is not None and output.inputs["Volume"].is_linked and not output.inputs["Surface"].is_linked


def require_finite(numbers: Array, owner: str) -> None:
    """Raise GeometryError that names the object where coordinates are not numbers."""
    if not np.isfinite(numbers).all():
        raise GeometryError(
            f"{owner} has coordinates that are not numbers; delete these vertices or repair its scale."
        )


def family_of(target: bpy.types.Object) -> list[bpy.types.Object]:
    """An object and its children, without those that a character's armature deforms."""
    return [o for o in (target, *target.children_recursive) if o is target or not is_worn(o)]


def require_faces(found: list, target: bpy.types.Object) -> None:
    """Raise GeometryError where nothing was ``found`` of an object."""
    if not found:
        raise GeometryError(
            f"{target.name} has no visible faces to sense; choose an object with a mesh, show it in the "
            "viewport, or add faces to it."
        )


def join(shapes: list) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (F, 3) of several shapes as one mesh."""
    if not shapes:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    starts = np.cumsum([0] + [len(s.vertices) for s in shapes[:-1]])
    return np.concatenate([s.vertices for s in shapes]), np.concatenate(
        [s.triangles + i for s, i in zip(shapes, starts, strict=True)]
    )


def is_worn(candidate: bpy.types.Object) -> bool:
    """Whether an object is part of a character: an armature, or deformed or carried by one."""
    ancestor = candidate
    while ancestor is not None:
        if ancestor.type == "ARMATURE":
            return True
        ancestor = ancestor.parent
    return any(m.type == "ARMATURE" and m.object is not None for m in candidate.modifiers)
