"""Parts of a loft as one mesh of Blender's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy
import numpy as np

from .loft import LoftPart


def loft_mesh(
    name: str, parts: Sequence[LoftPart], materials: Iterable[bpy.types.Material], smooth: bool
) -> bpy.types.Mesh:
    """Make a mesh of all ``parts``, their vertices in order; a part's ``material`` is its place among
    ``materials``.
    """
    starts = np.cumsum([0] + [len(p.vertices) for p in parts])
    faces = [
        tuple(int(s) + i for i in face) for part, s in zip(parts, starts, strict=False) for face in part.faces
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.concatenate([p.vertices for p in parts]).tolist(), [], faces)
    if smooth:
        mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), dtype=bool))
    mesh.polygons.foreach_set(
        "material_index",
        np.repeat([p.material for p in parts], [len(p.faces) for p in parts]).astype(np.intc),
    )
    for material in materials:
        mesh.materials.append(material)
    mesh.update()
    return mesh
