"""What all measuring of meshes begins with: checking, joining corners in one place, thinning what is too
fine, cutting what is large.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array

_AT_ONCE = 1 << 16


def check_mesh(vertices: Array, triangles: Array) -> tuple[Array, Array]:
    """Give vertices (V, 3) float64 and triangles (F, 3) int of a mesh that can be measured.

    Raises GeometryError when there are no triangles, indices without a vertex, or coordinates that are not
    finite.
    """
    vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.asarray(triangles).reshape(-1, 3)
    if not len(triangles) or not len(vertices):
        raise GeometryError("The mesh has no faces; choose an object that has a surface.")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise GeometryError("The mesh has faces without corners; run Mesh > Clean Up or export it again.")
    bad = ~np.isfinite(vertices).all(1)
    if bad.any() and bad[triangles].any():
        raise GeometryError("The mesh has coordinates that are not numbers; repair or delete these vertices.")
    return vertices, triangles.astype(np.int64)


def numbered(rows: Array) -> tuple[Array, Array]:
    """Number rows of integers (N, 3), equal ones alike: first row (K,) of each number, and numbers (N,).

    By one key a row, many times faster than comparing rows; two different rows get one key once in 1e7 meshes
    of a million.
    """
    rows = np.asarray(rows).astype(np.int64).view(np.uint64)
    key = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        key = (key ^ column) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    return first, number.reshape(-1)


def thin_out(vertices: Array, triangles: Array, size: float, least: int = 60_000) -> tuple[Array, Array]:
    """Join the corners of a dense mesh that share a cell of ``size`` metres; meshes of less than ``least``
    triangles stay.

    Vertices (V, 3), triangles (F, 3).  Each corner moves onto another one, at most by the diagonal of a cell;
    so flat faces stay flat, closed parts stay closed, and no distance changes by more than that.
    """
    if len(triangles) < least:
        return vertices, triangles
    first, number = numbered(np.floor(vertices / size))
    joined = number[triangles]
    a, b, c = joined.T
    return vertices[first], joined[(a != b) & (b != c) & (c != a)]


def cut_triangles(corners: Array, longest: float) -> Array:
    """Halve triangles (F, 3, 3) at their longest edge until no edge exceeds ``longest``: corners (F',
    3, 3).
    """
    done, square = [], longest**2
    while len(corners):
        edges = ((corners - np.roll(corners, -1, axis=1)) ** 2).sum(-1)  # edge k runs from corner k to k + 1
        k = edges.argmax(1)
        large = edges[np.arange(len(k)), k] > square
        done.append(corners[~large])
        corners, k = corners[large], k[large]
        rows = np.arange(len(k))
        a, b, c = (corners[rows, (k + i) % 3] for i in range(3))
        middle = (a + b) / 2
        corners = np.concatenate((np.stack((a, middle, c), 1), np.stack((middle, b, c), 1)))
    return np.concatenate(done) if done else np.zeros((0, 3, 3))


def expanded(count: Array) -> Iterator[tuple[Array, Array]]:
    """Go through rows ``count`` (N,) times each, so many at once as the caches hold: rows (M,) and times
    (M,).
    """
    ends = np.cumsum(count)
    for start in range(0, int(ends[-1]) if len(ends) else 0, _AT_ONCE):
        flat = np.arange(start, min(start + _AT_ONCE, int(ends[-1])))
        row = np.searchsorted(ends, flat, side="right")
        yield row, flat - (ends[row] - count[row])
