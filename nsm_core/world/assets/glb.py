"""Read GLB meshes for the object pool; trimesh, which does it, is a package of training alone and imported
only here.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.validate import is_number, listed, read_bytes, shown, table, whole

MOST_BYTES = 1 << 28
MOST_NODES = 20_000
MOST_CORNERS = 20_000_000  # of all parts together, each as often as it is placed
_FAR = 1e5  # metres
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}


def read_parts(path: Path) -> list[tuple[str, Array, Array]]:
    """Read the parts of a GLB: name, vertices (V, 3) metres, Z up and front -Y, and triangles (F, 3) of each.

    What the file declares is checked before anything is allocated for it.  Raises GeometryError where the
    file is broken, too large or has no faces; ModuleNotFoundError where trimesh is missing.
    """
    import trimesh

    check(path)
    try:
        scene = trimesh.load(path, force="scene", process=False)
        parts = []
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            mesh = scene.geometry[name]
            if len(getattr(mesh, "faces", ())):
                v = trimesh.transform_points(mesh.vertices, matrix)
                parts.append(
                    (str(node), np.stack((v[:, 0], -v[:, 2], v[:, 1]), axis=1), np.asarray(mesh.faces))
                )
    except Exception as error:  # whatever the reader stumbles over
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise GeometryError(f"{path} cannot be read ({reason}); export it again as GLB.") from error
    if not parts:
        raise GeometryError(f"{path} has no faces; export it again with its meshes.")
    for name, v, f in parts:
        if not np.isfinite(v).all() or np.abs(v).max(initial=0) > _FAR:
            raise GeometryError(
                f"{path}: {name} has corners that are no places within {_FAR:g} m; export it again."
            )
        if f.min() < 0 or f.max() >= len(v):
            raise GeometryError(
                f"{path}: {name} has faces between corners that are not there; export it again."
            )
    return parts


def check(path: Path) -> None:
    """Raise GeometryError where a GLB declares what its bytes do not hold: sizes, counts and places of its
    arrays, and its nodes.
    """
    data = read_bytes(path, GeometryError, "check the index", MOST_BYTES)
    where = path.name
    if len(data) < 20 or data[:4] != b"glTF":
        raise GeometryError(f"{where} is no GLB file; export it again as GLB.")
    size, kind = struct.unpack_from("<I4s", data, 12)
    if kind != b"JSON" or 20 + size > len(data):
        raise GeometryError(f"{where} is cut off or no GLB file; export it again as GLB.")
    try:
        found = json.loads(data[20 : 20 + size])
    except (ValueError, RecursionError) as error:
        raise GeometryError(
            f"{where}: its description is damaged ({str(error)[:80]}); export it again as GLB."
        ) from error
    found = table(found, where, GeometryError)
    entries = {
        key: _entries(found, key, where) for key in ("buffers", "bufferViews", "accessors", "meshes", "nodes")
    }
    views = [_view(v, f"{where}: buffer view {k}", len(data)) for k, v in enumerate(entries["bufferViews"])]
    counts = [_accessor(a, f"{where}: array {k}", views) for k, a in enumerate(entries["accessors"])]
    for k, buffer in enumerate(entries["buffers"]):
        if "uri" in buffer:
            raise GeometryError(
                f"{where}: its numbers lie in another file ({shown(buffer['uri'])}); export it again as GLB "
                "alone."
            )
        whole(buffer.get("byteLength"), f"{where}: the length of buffer {k}", GeometryError, 0, len(data))
    _nodes(entries["nodes"], [_corners(m, counts, where) for m in entries["meshes"]], where)


def _entries(found: dict[str, Any], key: str, where: str) -> list[dict[str, Any]]:
    entries = listed(found.get(key, []), f"{where}: {key}", GeometryError)
    return [table(e, f"{where}: {key} {k}", GeometryError) for k, e in enumerate(entries)]


def _view(view: dict[str, Any], where: str, size: int) -> int:
    """Bytes of a buffer view."""
    start = whole(view.get("byteOffset", 0), f"{where}: its begin", GeometryError, 0, size)
    return whole(view.get("byteLength"), f"{where}: its length", GeometryError, 0, size - start)


def _accessor(array: dict[str, Any], where: str, views: list[int]) -> int:
    """How many entries an array has, which its view must hold; one without a view is filled with zeros and
    refused.
    """
    kind, letter = array.get("type"), array.get("componentType")
    if (
        not isinstance(kind, str)
        or kind not in _WIDTHS
        or not isinstance(letter, int)
        or letter not in _BYTES
    ):
        raise GeometryError(f"{where} is of an unknown type; export it again as GLB.")
    view = whole(array.get("bufferView", -1), f"{where}: its view", GeometryError, 0, len(views) - 1)
    start = whole(array.get("byteOffset", 0), f"{where}: its begin", GeometryError, 0, views[view])
    return whole(
        array.get("count"),
        f"{where}: its count",
        GeometryError,
        0,
        (views[view] - start) // (_WIDTHS[kind] * _BYTES[letter]),
    )


def _corners(mesh: dict[str, Any], counts: list[int], where: str) -> int:
    """Corners and indices of a mesh together."""
    total = 0
    for part in _entries(mesh, "primitives", where):
        attributes = table(part.get("attributes", {}), f"{where}: attributes", GeometryError)
        for index in (*attributes.values(), part.get("indices", 0)):
            total += counts[
                whole(index, f"{where}: the number of an array", GeometryError, 0, len(counts) - 1)
            ]
    return total


def _nodes(nodes: list[dict[str, Any]], corners: list[int], where: str) -> None:
    """Check that nodes are few, hang on one another as a tree, are placed by numbers, and do not multiply
    meshes beyond measure.
    """
    if len(nodes) > MOST_NODES:
        raise GeometryError(f"{where} has {len(nodes)} nodes; join its parts and export it again.")
    parents = [-1] * len(nodes)
    total = 0
    for k, node in enumerate(nodes):
        for child in listed(node.get("children", []), f"{where}: children of node {k}", GeometryError):
            child = whole(child, f"{where}: a child of node {k}", GeometryError, 0, len(nodes) - 1)
            if parents[child] >= 0:
                raise GeometryError(f"{where}: node {child} hangs on two others; export it again.")
            parents[child] = k
        for key in ("matrix", "translation", "rotation", "scale"):
            if not all(
                is_number(v, -1e9, 1e9)
                for v in listed(node.get(key, []), f"{where}: {key} of node {k}", GeometryError)
            ):
                raise GeometryError(f"{where}: the {key} of node {k} is no place; export it again.")
        if "mesh" in node:
            total += corners[
                whole(node["mesh"], f"{where}: the mesh of node {k}", GeometryError, 0, len(corners) - 1)
            ]
    for k in range(len(nodes)):
        steps, at = 0, k
        while at >= 0:
            at, steps = parents[at], steps + 1
            if steps > 1000:
                raise GeometryError(
                    f"{where}: its nodes hang on one another in a ring or too deep; export it again."
                )
    if total > MOST_CORNERS:
        raise GeometryError(f"{where} has {total} corners; simplify its meshes and export it again.")


def joined(parts: list[tuple[str, Array, Array]]) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (F, 3) of all parts as one mesh."""
    starts = np.cumsum([0, *(len(v) for _, v, _ in parts)])
    return np.concatenate([v for _, v, _ in parts]), np.concatenate(
        [f + at for (_, _, f), at in zip(parts, starts[:-1], strict=True)]
    )
