"""From a mesh to voxels, and from voxels to the few cuboids that cover them (section 4.3)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from nsm_core.rotations import Array

from .triangles import check_mesh, expanded

RESOLUTION = 0.04
# A grid never grows beyond this many cells; larger meshes get larger cells.
_MOST_CELLS = 6_000_000
# Sheets without thickness get this much, metres.
_THINNEST = 0.002
# Closed-off space in which a box of this size fits, metres, is no solid: a person could stand there.
_PERSON_ROOM = np.array((1.0, 1.0, 1.5))
_PAIRS_AT_ONCE = 1 << 16
_TINY = 1e-6  # of a cell: what is so near to it touches it


@dataclass(frozen=True)
class VoxelGrid:
    """Voxels of a mesh, in the frame of the mesh.

    ``origin`` (3,) least corner and ``cell`` (3,) size of a voxel, metres; ``surface`` (X, Y, Z) bool:
    touched by the mesh; ``solid`` (X, Y, Z) bool: that and all it closes off from the outside.
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

    ``vertices`` (V, 3) metres, ``triangles`` (F, 3), ``resolution`` in metres.  The grid fits the bounding
    box, so cells are at most ``resolution`` wide, and outer faces keep their place.  What the surface closes
    off is solid, whichever way its faces look; a mesh that stays open, through gaps wider than a voxel, gives
    its surface alone. Closed-off space with room for a person is a room or a hall and stays free. Raises
    GeometryError on a mesh without faces or with coordinates that are not finite.
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
    flat = np.zeros(int(np.prod(shape)), dtype=bool)
    for start in range(0, len(corners), _PAIRS_AT_ONCE):
        part = corners[start : start + _PAIRS_AT_ONCE]
        low = np.clip(np.floor(part.min(1) - _TINY).astype(np.int64), 0, np.array(shape) - 1)
        high = np.clip(np.floor(part.max(1) + _TINY).astype(np.int64), 0, np.array(shape) - 1)
        wide = (high > low).sum(1)
        # In a single row of cells, or a single one, a triangle touches all of them from end to end.
        rows = np.flatnonzero(wide < 2)
        for at, step in expanded((high[rows] - low[rows]).sum(1) + 1):
            cells = low[rows[at]] + step[:, None] * (high[rows[at]] > low[rows[at]])
            flat[np.ravel_multi_index(cells.T, shape)] = True
        rows = np.flatnonzero(wide >= 2)
        normal = np.cross(part[rows, 1] - part[rows, 0], part[rows, 2] - part[rows, 0])
        main = np.abs(normal).argmax(1)
        for axis in range(3):
            its = rows[main == axis]
            if len(its):
                _mark(part[its], normal[main == axis], low[its], high[its], axis, flat, shape)
    return flat.reshape(shape)


def _mark(
    corners: Array,
    normal: Array,
    low: Array,
    high: Array,
    axis: int,
    flat: Array,
    shape: tuple[int, int, int],
) -> None:
    """Mark in ``flat`` the cells of triangles whose normals lie mainly along one axis, by separating axes.

    Seen along that axis, columns of cells beside the triangle fall away first; of the others the few cells
    remain that its plane passes, and these are looked at along the other two axes.
    """
    u, v, w = (axis + 1) % 3, (axis + 2) % 3, axis
    half = 0.5 + _TINY
    shadows = [_shadows(corners, j, k, half) for j, k in ((u, v), (v, w), (w, u))]
    steepness = np.abs(normal[:, w])
    plain = steepness > 0  # without an area there is no plane
    slope = -normal[:, (u, v)] / np.where(plain, steepness * np.sign(normal[:, w]), 1)[:, None]
    reach = np.where(plain, half * (1 + np.abs(slope).sum(1)) + 1e-9, np.inf)
    # Along the grid: no more to be looked at.
    level = plain & (np.abs(normal[:, (u, v)]).max(1) <= 1e-12 * steepness)
    size = high - low + 1
    for face, step in expanded(size[:, u] * size[:, v]):
        a, b = low[face, u] + step // size[face, v] + 0.5, low[face, v] + step % size[face, v] + 0.5
        met = _meets(shadows[0], face, a, b)
        face, a, b = face[met], a[met], b[met]
        middle = (
            corners[face, 0, w]
            + slope[face, 0] * (a - corners[face, 0, u])
            + slope[face, 1] * (b - corners[face, 0, v])
        )
        first = np.maximum(np.ceil(np.maximum(middle - reach[face], -1) - 0.5).astype(np.int64), low[face, w])
        last = np.minimum(
            np.floor(np.minimum(middle + reach[face], shape[w]) - 0.5).astype(np.int64), high[face, w]
        )
        for at, rise in expanded(np.maximum(last - first + 1, 0)):
            cells = np.empty((len(at), 3), np.int64)
            cells[:, u], cells[:, v], cells[:, w] = a[at], b[at], first[at] + rise
            c, its = cells[:, w] + 0.5, face[at]
            open_ = np.flatnonzero(~level[its])
            hit = np.ones(len(at), bool)
            if len(open_):
                i = its[open_]
                hit[open_] = _meets(shadows[1], i, b[at[open_]], c[open_]) & _meets(
                    shadows[2], i, c[open_], a[at[open_]]
                )
            flat[np.ravel_multi_index(cells[hit].T, shape)] = True


def _shadows(corners: Array, j: int, k: int, half: float) -> tuple[Array, Array, Array, Array]:
    """For each edge (3, F) of triangles seen in the plane of axes ``j``, ``k``: its normal, and between which
    values along it the middles lie of the cells that the triangle's shadow can meet.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    a, b = -edges[:, :, k].T, edges[:, :, j].T
    along = a[:, :, None] * corners[None, :, :, j] + b[:, :, None] * corners[None, :, :, k]
    reach = half * (np.abs(a) + np.abs(b)) + 1e-12
    return a, b, along.min(2) - reach, along.max(2) + reach


def _meets(shadow: tuple[Array, Array, Array, Array], face: Array, x: Array, y: Array) -> Array:
    """Whether cells with middles ``x``, ``y`` (N,) meet the shadows of triangles ``face`` (N,)."""
    met = np.ones(len(face), bool)
    for a, b, low, high in zip(*shadow, strict=True):
        along = a[face] * x + b[face] * y
        met &= (along >= low[face]) & (along <= high[face])
    return met


def _border(shape: tuple[int, ...]) -> Array:
    """Cells (X, Y, Z) at the border of a grid."""
    border = np.ones(shape, dtype=bool)
    border[1:-1, 1:-1, 1:-1] = False
    return border


def _reach(seed: Array, free: Array) -> Array:
    """Cells (X, Y, Z) that connect to a seed through faces of free cells, by sweeps to and fro along each
    axis.
    """
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
    """Cover the solid voxels exactly with few cuboids that do not overlap: mins, maxs (M, 3) metres, frame of
    the mesh.

    Neighbours that together form a cuboid are merged until no two do (section 4.3), in the order of axes that
    leaves the fewest.
    """
    cells = np.argwhere(grid.solid)
    start = np.concatenate((cells, cells + 1), axis=1)
    orders = [_merge(start, order) for order in permutations(range(3))]
    boxes = min(orders, key=len)
    return grid.origin + boxes[:, :3] * grid.cell, grid.origin + boxes[:, 3:] * grid.cell


def _merge(boxes: Array, order: tuple[int, ...]) -> Array:
    """Merge boxes (M, 6) of cell indices, minima then maxima, along the axes in turn until nothing
    changes.
    """
    before = -1
    while len(boxes) != before:
        before = len(boxes)
        for axis in order:
            others = [c for c in range(6) if c % 3 != axis]
            boxes = boxes[np.lexsort((boxes[:, axis], *(boxes[:, c] for c in others)))]
            same = (boxes[1:, others] == boxes[:-1, others]).all(1) & (
                boxes[1:, axis] == boxes[:-1, axis + 3]
            )
            first = np.flatnonzero(np.append(True, ~same)) if len(boxes) else np.zeros(0, int)
            last = np.append(first[1:], len(boxes)) - 1 if len(boxes) else first
            merged = boxes[first].copy()
            merged[:, axis + 3] = boxes[last, axis + 3]
            boxes = merged
    return boxes
