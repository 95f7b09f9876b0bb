"""Which faces of a mesh tell inside from outside: those of closed parts whose faces agree."""

from __future__ import annotations

import numpy as np

from ..rotations import Array
from .pieces import check_mesh

# Corners nearer than this are one, metres: exporters split vertices at hard edges and seams.
_WELD = 1e-5


def face_sides(vertices: Array, triangles: Array) -> Array:
    """Tell for each triangle (F,) int8 where the solid lies: 1 behind it, -1 before it (inside out), 0 unknown.

    ``vertices`` (V, 3) metres, ``triangles`` (F, 3).  A face is known when its connected part is closed: every edge
    has as many faces on its one side as on its other.  Raises GeometryError as ``check_mesh`` does.
    """
    vertices, triangles = check_mesh(vertices, triangles)
    _, weld = np.unique(np.round(vertices / _WELD).astype(np.int64), axis=0, return_inverse=True)
    faces = weld.reshape(-1)[triangles]
    part = _parts(faces, int(faces.max()) + 1)
    edges = np.stack((faces, np.roll(faces, -1, axis=1)), axis=-1).reshape(-1, 2)
    forward = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    _, edge = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    edge = edge.reshape(-1)
    balance = np.bincount(edge, weights=forward)
    owner = np.repeat(part, 3)
    count = int(part.max()) + 1
    open_ = np.zeros(count, dtype=bool)
    open_[owner[(balance[edge] != 0) & (edges[:, 0] != edges[:, 1])]] = True
    corners = vertices[triangles] - vertices[triangles].mean((0, 1))
    volume = np.bincount(part, weights=np.linalg.det(corners) / 6, minlength=count)
    side = np.where(open_ | (np.abs(volume) < 1e-9), 0, np.sign(volume)).astype(np.int8)
    return side[part]


def _parts(faces: Array, vertex_count: int) -> Array:
    """Number (F,) of the connected part of each face (F, 3), joined at vertices: least labels spread until they rest."""
    label = np.arange(vertex_count)
    while True:
        least = label[faces].min(1)
        spread = label.copy()
        np.minimum.at(spread, faces.reshape(-1), np.repeat(least, 3))
        spread = spread[spread]  # follow the labels: halves the number of rounds at least
        if (spread == label).all():
            break
        label = spread
    return np.unique(label[faces[:, 0]], return_inverse=True)[1].reshape(-1)
