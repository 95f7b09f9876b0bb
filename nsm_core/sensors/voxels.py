"""From a mesh to voxels, and from voxels to the few cuboids that cover them (section 4.3)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from ..rotations import Array
from .pieces import check_mesh, cut_triangles

RESOLUTION = 0.04
# A grid never grows beyond this many cells; larger meshes get larger cells.
_MOST_CELLS = 6_000_000
# Sheets without thickness get this much, metres.
_THINNEST = 0.002
# Closed-off space in which a box of this size fits, metres, is no solid: a person could stand there.
_PERSON_ROOM = np.array((1.0, 1.0, 1.5))
_PAIRS_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class VoxelGrid:
    """Voxels of a mesh, in the frame of the mesh.

    ``origin`` (3,) least corner and ``cell`` (3,) size of a voxel, metres; ``surface`` (X, Y, Z) bool: touched by the
    mesh; ``solid`` (X, Y, Z) bool: that and all it closes off from the outside.
    """

    origin: Array
    cell: Array
    surface: Array
    solid: Array

    @property
    def diagonal(self) -> float:
        """Diagonal of a voxel, metres: no point of a surface voxel is farther from the mesh."""
        return float(np.linalg.norm(self.cell))


def voxelise(vertices: Array, triangles: Array, resolution: float = RESOLUTION) -> VoxelGrid:
    """Mark the voxels that a mesh touches or encloses.

    ``vertices`` (V, 3) metres, ``triangles`` (F, 3), ``resolution`` in metres.  The grid fits the bounding box, so
    cells are at most ``resolution`` wide, and outer faces keep their place.  What the surface closes off is solid,
    whichever way its faces look; a mesh that stays open, through gaps wider than a voxel, gives its surface alone.
    Closed-off space with room for a person is a room or a hall and stays free.
    Raises GeometryError on a mesh without faces or with coordinates that are not finite.
    """
    vertices, triangles = check_mesh(vertices, triangles)
    corners = vertices[triangles]
    low, high = corners.min((0, 1)), corners.max((0, 1))
    extent = np.maximum(high - low, _THINNEST)
    origin = (low + high - extent) / 2
    resolution = max(resolution, float(np.cbrt(np.prod(np.maximum(extent, resolution)) / _MOST_CELLS)))
    shape = np.maximum(np.ceil(extent / resolution - 1e-6).astype(int), 1)
    cell = extent / shape
    surface = _touched((corners - origin) / cell, tuple(shape))
    inner = ~surface & ~_reach(_border(surface.shape), ~surface)
    if inner.any() and (extent > _PERSON_ROOM).all():
        inner &= ~_reach(_windows(inner, np.ceil(_PERSON_ROOM / cell).astype(int)), inner)
    return VoxelGrid(origin, cell, surface, surface | inner)


def _touched(corners: Array, shape: tuple[int, int, int]) -> Array:
    """Mark the unit cells (X, Y, Z) that triangles (F, 3, 3) touch, faces of cells included."""
    grid = np.zeros(shape, dtype=bool)
    flat = grid.reshape(-1)
    top = np.array(shape) - 1
    # Pieces shorter than a cell reach over two cells an axis at most.
    pieces = cut_triangles(corners, 0.99)
    tiny = 1e-6
    low = np.clip(np.floor(pieces.min(1) - tiny).astype(np.int64), 0, top)
    high = np.clip(np.floor(pieces.max(1) + tiny).astype(np.int64), 0, top)
    span = high - low
    inside = (span == 0).all(1)
    flat[np.ravel_multi_index(low[inside].T, shape)] = True
    pieces, low, span = pieces[~inside], low[~inside], span[~inside]
    # Two pieces in three straddle one border only: each neighbour holds a corner then, and needs no further test.
    single = (span > 0).sum(1) == 1
    for offset in np.ndindex(2, 2, 2):
        reached = (span >= offset).all(1)
        rows = np.flatnonzero(reached & single)
        flat[np.ravel_multi_index((low[rows] + offset).T, shape)] = True
        rows = np.flatnonzero(reached & ~single)
        rows = rows[~flat[np.ravel_multi_index((low[rows] + offset).T, shape)]]
        for start in range(0, len(rows), _PAIRS_AT_ONCE):
            part = rows[start : start + _PAIRS_AT_ONCE]
            cells = low[part] + offset
            hit = _overlap(pieces[part] - (cells + 0.5)[:, None], 0.5 + tiny)
            flat[np.ravel_multi_index(cells[hit].T, shape)] = True
    return grid


def _overlap(corners: Array, half: float) -> Array:
    """Whether triangles (K, 3, 3) meet a cube of ``half`` its width at the origin; their bounding boxes are known to.

    Separating axes: the normal, and each edge crossed with each axis of the cube.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    meets = np.abs((normal * corners[:, 0]).sum(1)) <= half * np.abs(normal).sum(1) + 1e-12
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        for e in range(3):
            a, b = -edges[:, e, k, None], edges[:, e, j, None]
            shadow = a * corners[:, :, j] + b * corners[:, :, k]
            reach = half * (np.abs(a) + np.abs(b))[:, 0] + 1e-12
            meets &= (shadow.min(1) <= reach) & (shadow.max(1) >= -reach)
    return meets


def _border(shape: tuple[int, ...]) -> Array:
    """Cells (X, Y, Z) at the border of a grid."""
    border = np.ones(shape, dtype=bool)
    border[1:-1, 1:-1, 1:-1] = False
    return border


def _reach(seed: Array, free: Array) -> Array:
    """Cells (X, Y, Z) that connect to a seed through faces of free cells, by sweeps to and fro along each axis."""
    found = seed & free
    before = -1
    while (count := int(np.count_nonzero(found))) != before:
        before = count
        for axis in range(3):
            reached, passable = np.moveaxis(found, axis, 0), np.moveaxis(free, axis, 0)
            for i in range(1, len(reached)):
                reached[i] |= reached[i - 1] & passable[i]
            for i in range(len(reached) - 2, -1, -1):
                reached[i] |= reached[i + 1] & passable[i]
    return found


def _windows(mask: Array, size: Array) -> Array:
    """Least corners (X, Y, Z) of all windows of ``size`` (3,) cells that lie wholly in the mask."""
    if (np.array(mask.shape) < size).any():
        return np.zeros_like(mask)
    for axis, n in enumerate(size):
        total = np.cumsum(mask, axis=axis, dtype=np.int32)
        total = np.concatenate((np.zeros_like(total.take([0], axis)), total), axis)
        count = mask.shape[axis] + 1 - n
        whole = total.take(np.arange(n, n + count), axis) - total.take(np.arange(count), axis) == n
        mask = np.concatenate((whole, np.zeros_like(mask.take(np.arange(n - 1), axis))), axis)
    return mask


def merge(grid: VoxelGrid) -> tuple[Array, Array]:
    """Cover the solid voxels exactly with few cuboids that do not overlap: mins, maxs (M, 3) metres, frame of the mesh.

    Neighbours that together form a cuboid are merged until no two do (section 4.3), in the order of axes that leaves
    the fewest.
    """
    cells = np.argwhere(grid.solid)
    start = np.concatenate((cells, cells + 1), axis=1)
    orders = [_merge(start, order) for order in permutations(range(3))]
    boxes = min(orders, key=len)
    return grid.origin + boxes[:, :3] * grid.cell, grid.origin + boxes[:, 3:] * grid.cell


def _merge(boxes: Array, order: tuple[int, ...]) -> Array:
    """Merge boxes (M, 6) of cell indices, minima then maxima, along the axes in turn until nothing changes."""
    before = -1
    while len(boxes) != before:
        before = len(boxes)
        for axis in order:
            others = [c for c in range(6) if c % 3 != axis]
            boxes = boxes[np.lexsort((boxes[:, axis], *(boxes[:, c] for c in others)))]
            same = (boxes[1:, others] == boxes[:-1, others]).all(1) & (boxes[1:, axis] == boxes[:-1, axis + 3])
            first = np.flatnonzero(np.append(True, ~same)) if len(boxes) else np.zeros(0, int)
            last = np.append(first[1:], len(boxes)) - 1 if len(boxes) else first
            merged = boxes[first].copy()
            merged[:, axis + 3] = boxes[last, axis + 3]
            boxes = merged
    return boxes
