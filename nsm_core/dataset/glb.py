"""Read GLB meshes for the object pool; trimesh, which does it, is a package of training alone and imported only here."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import GeometryError
from ..rotations import Array


def read_parts(path: Path) -> list[tuple[str, Array, Array]]:
    """Read the parts of a GLB: name, vertices (V, 3) metres, Z up and front -Y, and triangles (F, 3) of each.

    Raises GeometryError where the file is broken or has no faces; ModuleNotFoundError where trimesh is missing.
    """
    import trimesh

    try:
        scene = trimesh.load(path, force="scene", process=False)
        parts = []
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            mesh = scene.geometry[name]
            if len(getattr(mesh, "faces", ())):
                v = trimesh.transform_points(mesh.vertices, matrix)
                parts.append((str(node), np.stack((v[:, 0], -v[:, 2], v[:, 1]), axis=1), np.asarray(mesh.faces)))
    except Exception as error:  # whatever the reader stumbles over
        raise GeometryError(f"{path} cannot be read ({error}); export it again as GLB.") from error
    if not parts:
        raise GeometryError(f"{path} has no faces; export it again with its meshes.")
    return parts


def joined(parts: list[tuple[str, Array, Array]]) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (F, 3) of all parts as one mesh."""
    starts = np.cumsum([0, *(len(v) for _, v, _ in parts)])
    return np.concatenate([v for _, v, _ in parts]), np.concatenate([f + at for (_, _, f), at in zip(parts, starts[:-1], strict=True)])
