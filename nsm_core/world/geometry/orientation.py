"""Which faces of a mesh tell inside from outside: those of closed parts whose faces agree."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array

from .triangles import check_mesh, numbered

# Corners nearer than this are one, metres: exporters split vertices at hard edges and seams.
_WELD = 1e-5
_AT_ONCE = 1 << 16  # values in one call that keeps other threads waiting


def face_sides(vertices: Array, triangles: Array) -> Array:
    """Tell for each triangle (F,) int8 where the solid lies: 1 behind it, -1 before it (inside out), 0
    unknown.

    ``vertices`` (V, 3) metres, ``triangles`` (F, 3).  A face is known when its connected part is closed:
    every edge has as many faces on its one side as on its other.  Raises GeometryError as ``check_mesh``
    does.
    """
    vertices, triangles = check_mesh(vertices, triangles)
    faces = _welded(vertices, triangles)
    part = _parts(faces, int(faces.max()) + 1)
    count = int(part.max()) + 1
    open_ = np.zeros(count, dtype=bool)
    open_[part[_open_edges(faces)]] = True
    corners = vertices[triangles]
    corners -= vertices.mean(0)
    a, b, c = np.moveaxis(corners, 1, 0)
    volume = np.bincount(part, weights=(np.cross(a, b) * c).sum(1) / 6, minlength=count)
    side = np.where(open_ | (np.abs(volume) < 1e-9), 0, np.sign(volume)).astype(np.int8)
    return side[part]


def connected_parts(vertices: Array, triangles: Array) -> Array:
    """Number (F,) of the connected part of each triangle (F, 3); corners (V, 3) in one place are one.  Raises
    as ``check_mesh``.
    """
    vertices, triangles = check_mesh(vertices, triangles)
    faces = _welded(vertices, triangles)
    return _parts(faces, int(faces.max()) + 1)


def _welded(vertices: Array, triangles: Array) -> Array:
    """Triangles (F, 3) over corners that are numbered by their places."""
    return numbered(np.round(vertices / _WELD))[1][triangles]


def _open_edges(faces: Array) -> Array:
    """Faces that have an edge with more faces on its one side than on its other, some of them twice."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    real = np.flatnonzero(start != end)
    start, end = start[real], end[real]
    key = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    order = np.argsort(key)
    key = key[order]
    first = np.flatnonzero(np.append(True, key[1:] != key[:-1])) if len(key) else np.zeros(0, np.int64)
    if not len(first):
        return first
    balance = np.add.reduceat(np.where(start < end, 1, -1)[order], first)
    return real[order[np.repeat(balance != 0, np.diff(np.append(first, len(key))))]] // 3


def _parts(faces: Array, vertex_count: int) -> Array:
    """Number (F,) of the connected part of each face (F, 3), joined at vertices: least labels spread until
    they rest.
    """
    order = np.argsort(faces.reshape(-1), kind="stable")
    corner = faces.reshape(-1)[order]
    first = np.flatnonzero(np.append(True, corner[1:] != corner[:-1]))
    owner, corner = order // 3, corner[first]
    label = np.arange(vertex_count)
    while True:
        least = label[faces].min(1)
        spread = label.copy()
        # Faces also pull on the roots of their corners' trees, so that the number of rounds grows with the
        # logarithm.
        spread[corner] = np.minimum.reduceat(least[owner], first)
        roots = label[faces].reshape(-1)
        low = np.repeat(least, 3)
        falls = np.flatnonzero(low < roots)
        for some in np.array_split(falls, len(falls) // _AT_ONCE + 1):
            np.minimum.at(spread, roots[some], low[some])
        spread = spread[spread]
        spread = spread[spread]  # follow the labels
        if (spread == label).all():
            break
        label = spread
    return np.unique(label[faces[:, 0]], return_inverse=True)[1].reshape(-1)
