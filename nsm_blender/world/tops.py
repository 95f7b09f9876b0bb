"""The level top of a mesh seen from above: where a box can be set down on it, and where one can stand
on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.dilation import grown
from nsm_core.world.geometry.triangles import cut_triangles

from .beside import freely

CELL = 0.02  # metres
_EVEN = 0.02  # how uneven a level may be, metres
_SLOT = 2  # cells of gaps between boards that count as closed
_LEVEL = 0.97  # cosine of how far a board may slope
_LEAST_AREA = 0.02  # square metres
_WINDOW = 2.2  # metres around a place in which the tops of large things are looked for


@dataclass
class Level:
    """A level top, as cells seen from above.

    ``height`` metres; ``top`` (X, Y) cells that belong to it and ``free`` those of them on which nothing
    stands; ``corner`` (2,) of cell 0, 0, metres.  Facing +Y looks from the near edge over the top.
    """

    height: float
    top: Array
    free: Array
    corner: Array

    @property
    def area(self) -> float:
        """Square metres."""
        return float(self.top.sum()) * CELL**2

    def seen_from(self, quarter: int) -> Level:
        """The same top in axes that are turned by ``quarter`` times 90 degrees: what faced +Y there faces +Y
        of the result.
        """
        top, free, corner = self.top, self.free, self.corner
        for _ in range(quarter % 4):
            corner = np.array((corner[1], -corner[0] - len(top) * CELL))
            top, free = top.T[:, ::-1], free.T[:, ::-1]
        return Level(self.height, top, free, corner)

    def depth(self) -> float:
        """Median way over the top along Y, metres."""
        columns = self.top[self.top.any(1)].sum(1)
        return float(np.median(columns)) * CELL if len(columns) else 0.0


@freely()
def find_levels(vertices: Array, triangles: Array, near: Array) -> list[Level]:
    """Find the level tops of a mesh, the largest first; ``vertices`` (V, 3) metres with Z up, ``triangles``
    (F, 3).

    Of a mesh larger than a few metres, a floor or a stage say, only the part nearest to ``near`` (2,) is
    looked at.  Levels smaller than a sheet of paper are left out.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    low, high = vertices[:, :2].min(0), vertices[:, :2].max(0)
    middle = np.clip(
        near, np.minimum(low + _WINDOW, (low + high) / 2), np.maximum(high - _WINDOW, (low + high) / 2)
    )
    samples = _samples(vertices[triangles], middle - _WINDOW - CELL, middle + _WINDOW + CELL)
    if not len(samples):
        return []
    corner = samples[:, :2].min(0) - 0.5 * CELL
    cells = ((samples[:, :2] - corner) / CELL).astype(np.int64)
    shape = cells.max(0) + 1
    heights = np.full(shape[0] * shape[1], -np.inf)
    np.maximum.at(heights, cells[:, 0] * shape[1] + cells[:, 1], samples[:, 2])
    heights = heights.reshape(shape)
    levels, left = [], np.isfinite(heights)
    while left.any():
        values = heights[left]
        bins = np.floor(values / _EVEN).astype(np.int64)
        found, counts = np.unique(bins, return_counts=True)
        height = float(np.median(values[bins == found[counts.argmax()]]))
        mask = left & (np.abs(heights - height) < _EVEN)
        if mask.sum() * CELL**2 < _LEAST_AREA:
            break
        closed = _shrink(grown(np.pad(mask, _SLOT), _SLOT), _SLOT)[_SLOT:-_SLOT, _SLOT:-_SLOT]
        top = closed & ((heights < height + _EVEN) | mask)
        levels.append(Level(height, top, top.copy(), corner))
        left &= ~mask
    return sorted(levels, key=lambda level: -level.area)


def boards_of(vertices: Array, triangles: Array, near: Array) -> list[Level]:
    """All level boards of a mesh, those too that are seen from above by nobody, such as a shelf's, from the
    lowest up; as ``find_levels``, and what stands over them is to be told to ``occupy``.
    """
    corners = np.asarray(vertices, dtype=np.float64)[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    level = normal[:, 2] > _LEVEL * np.maximum(area, 1e-12)
    height = np.round(corners[:, :, 2].mean(1) / _EVEN).astype(np.int64)
    found: list[Level] = []
    for step in np.unique(height[level]):
        some = level & (height == step)
        if area[some].sum() / 2 >= _LEAST_AREA:
            found += find_levels(vertices, triangles[some], near)[:1]
    return found


@freely()
def occupy(level: Level, meshes: Iterable[tuple[Array, Array]], height: float) -> None:
    """Take the cells away from ``free`` above which a mesh stands lower than ``height`` metres over the top;
    same frame as the level.
    """
    low = np.append(level.corner, level.height + 0.01)
    high = np.append(level.corner + np.array(level.top.shape) * CELL, level.height + height)
    for vertices, triangles in meshes:
        points = _cut(np.asarray(vertices, dtype=np.float64)[triangles], low, high)
        points = points[((points >= low) & (points < high)).all(1)]
        cells = ((points[:, :2] - level.corner) / CELL).astype(np.int64)
        level.free[cells[:, 0], cells[:, 1]] = False


def occupy_rectangle(level: Level, centre: Array, size: Array, turn: float) -> None:
    """Take the cells of a rectangle away from ``free``: ``centre`` (2,) and ``size`` (2,) metres, turned by
    ``turn`` radians.
    """
    x, y = np.meshgrid(
        *(level.corner[k] + CELL * (np.arange(level.top.shape[k]) + 0.5) for k in (0, 1)), indexing="ij"
    )
    own = rotate_planar(np.stack((x, y), -1) - centre, np.float64(-turn))
    level.free &= ~(np.abs(own) <= np.asarray(size) / 2 + CELL).all(-1)


def places_near_edge(
    level: Level, width: float, depth: float, margin: float, reach: float
) -> Iterator[tuple[float, float, float, float]]:
    """Yield the places of a ``width`` by ``depth`` thing behind the near edge.

    Each is the x of its middle, the y of its near face, the gap between the edge and this face, and the top's
    width on the narrower side of it; metres, in the level's axes.  The gap is at least ``margin`` and at most
    ``reach``.
    """
    nx, ny = int(np.ceil(width / CELL)) + 1, int(np.ceil(depth / CELL)) + 1
    if level.top.shape[0] < nx or level.top.shape[1] < ny:
        return
    total = np.pad(np.cumsum(np.cumsum(level.free, 0), 1), ((1, 0), (1, 0)))
    fits = total[nx:, ny:] - total[:-nx, ny:] - total[nx:, :-ny] + total[:-nx, :-ny] == nx * ny
    # Things before a place shut it off: it is reached from the near edge.
    taken = np.pad(np.cumsum(np.cumsum(level.top & ~level.free, 0), 1), ((1, 0), (1, 0)))
    fits &= (taken[nx:] - taken[:-nx])[:, ny:] == 0
    for i in range(0, fits.shape[0], 2):
        middle = level.top[i + nx // 2]
        if not middle.any():
            continue
        edge = int(middle.argmax())
        first = edge + int(np.ceil(margin / CELL + 0.5))
        rows = np.flatnonzero(fits[i, first:])
        if not len(rows):
            continue
        gap = (first + int(rows[0]) - edge - 0.5) * CELL
        if gap <= reach:
            row = first + int(rows[0])
            across = np.flatnonzero(level.top[:, row + ny // 2])
            beside = min(i - int(across[0]), int(across[-1]) + 1 - i - nx) * CELL
            yield (
                float(level.corner[0] + (i + nx / 2) * CELL),
                float(level.corner[1] + row * CELL),
                gap,
                beside,
            )


def standing_room(level: Level, from_edge: float) -> Array:
    """Places (N, 2) on the top, level's axes, at least ``from_edge`` metres from its edges and from what
    stands on it.
    """
    n = round(from_edge / CELL)
    room = _shrink(np.pad(level.free, 1), n)[1:-1, 1:-1] if n else level.free
    return level.corner + CELL * (np.argwhere(room) + 0.5)


def _samples(corners: Array, low: Array, high: Array) -> Array:
    """Points (N, 3) on triangles (F, 3, 3) between two corners (2,) of the floor, dense enough for every cell
    of the map.
    """
    # Steep faces need few samples: cut them by a length that counts height less.
    squeeze = np.array((1, 1, 0.3))
    points = _cut(corners * squeeze, np.append(low, -np.inf), np.append(high, np.inf)) / squeeze
    return points[((points[:, :2] >= low) & (points[:, :2] <= high)).all(1)]


def _cut(corners: Array, low: Array, high: Array) -> Array:
    """Corners (N, 3) of triangles (F, 3, 3) cut to the size of cells, of those near the box from ``low`` to
    ``high`` (3,).
    """
    # Walls and floors are cut coarsely first, and only what is near finely.
    for longest in (np.inf, 2.0, 0.3):
        corners = cut_triangles(corners, longest)
        corners = corners[((corners.max(1) >= low) & (corners.min(1) <= high)).all(1)]
    return cut_triangles(corners, 0.85 * CELL).reshape(-1, 3)


def _shrink(mask: Array, n: int) -> Array:
    """Cells whose square neighbourhood of ``n`` cells is set; what lies outside the map is not."""
    return ~grown(np.pad(~mask, n, constant_values=True), n)[n:-n, n:-n] if n else mask


def crossings(vertices: Array, triangles: Array, place: Array) -> Array:
    """Heights (N,) at which the vertical line through ``place`` (2,) meets triangles (F, 3)."""
    if (vertices[:, :2].min(0) > place).any() or (vertices[:, :2].max(0) < place).any():
        return np.zeros(0)
    corners = vertices[triangles]
    flat = corners[..., :2]
    corners = corners[((flat.min(1) <= place) & (flat.max(1) >= place)).all(1)].astype(np.float64)
    a, b, c = (corners[:, k, :2] for k in range(3))

    def cross(p: Array, q: Array) -> Array:
        return p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]

    double = cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.stack((cross(b - place, c - place), cross(c - place, a - place)), -1) / double[:, None]
        share = np.column_stack((share, 1 - share.sum(1)))
    return (share * corners[..., 2]).sum(1)[(share >= -1e-9).all(1)]
