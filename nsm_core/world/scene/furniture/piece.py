"""A piece of furniture made of boxes, and what can be told from it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Cuboids

# How far behind the front edge of a seat the hips go, and what they keep free of the back, metres.
HIP_BEHIND_EDGE = 0.28
HIP_FROM_BACK = 0.15


@dataclass
class Seat:
    """A place to sit.

    ``point`` (3,) on the seat surface where the hips go, metres, object frame; ``heading`` the way a sitter
    faces, radians (0 faces -Y of the object); ``height`` of the surface over the floor, ``width`` and
    ``depth`` of the seat in metres; ``back`` and ``arms`` tell whether there is something to lean on.
    """

    point: Array
    heading: float
    height: float
    width: float
    depth: float
    back: bool = False
    arms: bool = False


def hip_setback(depth: float) -> float:
    """How far behind the front edge the hips go on a seat of ``depth`` metres, metres."""
    return min(HIP_BEHIND_EDGE, max(depth - HIP_FROM_BACK, depth / 2))


Part = tuple[float, float, float, float, float, float]  # x0, x1, y0, y1, z0, z1


@dataclass
class Furniture:
    """A piece of furniture.

    ``vertices`` (V, 3) metres and ``triangles`` (F, 3) of closed boxes, facing outwards; ``mins``, ``maxs``
    (M, 3) the same boxes exactly; all in the object frame.  ``seat`` is None where nobody can sit;
    ``opening`` is the gap in a wall through which a person walks: from x0 to x1 and up to a height, metres,
    None where there is none.
    """

    kind: str
    vertices: Array
    triangles: Array
    mins: Array
    maxs: Array
    seat: Seat | None
    opening: tuple[float, float, float] | None = None

    @property
    def centre(self) -> Array:
        """Centre (3,) of the bounding box, object frame."""
        return (self.mins.min(0) + self.maxs.max(0)) / 2

    @property
    def size(self) -> Array:
        """Size (3,) of the bounding box, metres."""
        return self.maxs.max(0) - self.mins.min(0)

    def require_seat(self) -> Seat:
        """The seat; GeometryError where nobody can sit."""
        if self.seat is None:
            raise GeometryError(f"Nobody sits on a {self.kind}; choose a piece with a seat.")
        return self.seat

    def require_opening(self) -> tuple[float, float, float]:
        """The gap through which a person walks; GeometryError where there is none."""
        if self.opening is None:
            raise GeometryError(f"Nobody walks through a {self.kind}; choose a piece with an opening.")
        return self.opening


_LEVEL = 0.015  # metres by which boxes of one level surface may differ

# Corners of a box as (x, y, z) choices of minimum or maximum, and its twelve triangles seen from outside.
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_TRIANGLES = np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))])


def box_mesh(mins: Array, maxs: Array) -> tuple[Array, Array]:
    """Closed mesh of boxes: vertices (8 M, 3) float32 and outward triangles (12 M, 3) of ``mins``, ``maxs``
    (M, 3).
    """
    mins, maxs = np.asarray(mins), np.asarray(maxs)
    corners = np.where(_CORNERS[None] == 1, maxs[:, None], mins[:, None]).astype(np.float32)
    triangles = _TRIANGLES[None] + 8 * np.arange(len(mins))[:, None, None]
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def cuboids(placed: Iterable[tuple[Furniture, Array, float]]) -> Cuboids:
    """Collider of furniture at world positions (2,) or (3,), metres, and headings, radians."""
    return Cuboids([(position, heading, f.mins, f.maxs) for f, position, heading in placed])


def build(kind: str, boxes: list[Part], seat: Seat | None = None, centred: bool = True) -> Furniture:
    """Build a piece of boxes (at least one) and, ``centred``, move its footprint's centre to the origin.

    Raises GeometryError where a box has no extent.
    """
    a = np.array(boxes, dtype=np.float32).reshape(-1, 3, 2)
    mins, maxs = a[..., 0], a[..., 1]
    if (maxs - mins <= 0).any():
        raise GeometryError(f"These measures leave no room for every part of a {kind}; choose larger ones.")
    # The footprint is centred, whatever leans out at the back.
    shift = (mins.min(0) + maxs.max(0)) / 2 * np.array((1, 1, 0), np.float32) * centred
    mins, maxs = mins - shift, maxs - shift
    if seat is not None:
        seat.point = (seat.point - shift).astype(np.float32)
    return Furniture(kind, *box_mesh(mins, maxs), mins, maxs, seat)


def top_of(piece: Furniture, headroom: float = 0.35, highest: float = 1.3) -> tuple[float, Array]:
    """Find the largest level rectangle on which something can be put.

    Returns its height, metres, and its corners (2, 2) (least x, y and greatest x, y), object frame.  Surfaces
    with less than ``headroom`` metres free above them, or higher than ``highest``, do not count.  Raises
    GeometryError where there is none.
    """
    levels = np.unique(np.round(piece.maxs[piece.maxs[:, 2] <= highest, 2].astype(np.float64), 3))
    grid = [
        np.unique(np.round(np.concatenate((piece.mins[:, a], piece.maxs[:, a])).astype(np.float64), 3))
        for a in (0, 1)
    ]
    middle = [(g[1:] + g[:-1]) / 2 for g in grid]
    # Which box covers which cell of the grid that the boxes' own edges make, (M, X, Y).
    inside = [(piece.mins[:, a, None] < middle[a]) & (middle[a] < piece.maxs[:, a, None]) for a in (0, 1)]
    covers = inside[0][:, :, None] & inside[1][:, None, :]
    best: tuple[float, float, Array] | None = None
    for level in levels:
        carries = (np.abs(piece.maxs[:, 2] - level) < _LEVEL) & (piece.maxs[:, 2] <= level + 1e-3)
        blocks = (piece.maxs[:, 2] > level + 1e-3) & (piece.mins[:, 2] < level + headroom)
        area, corners = _largest_rectangle(covers[carries].any(0) & ~covers[blocks].any(0), *grid)
        # Of equals the higher wins: the lower may be the same cells a little under it.
        if area > 0 and (best is None or area >= best[0] - 1e-6):
            best = area, float(level), corners
    if best is None:
        raise GeometryError(
            f"Nothing can be put on this {piece.kind}: it has no free level top; choose another object."
        )
    return best[1], best[2]


def _largest_rectangle(free: Array, x: Array, y: Array) -> tuple[float, Array]:
    """Area and corners (2, 2) of the largest rectangle of free cells (X, Y) between the lines ``x`` (X + 1,),
    ``y`` (Y + 1,).
    """
    best, corners = 0.0, np.zeros((2, 2))
    for a in range(len(free)):
        rows = np.ones(free.shape[1], bool)
        for b in range(a, len(free)):
            rows &= free[b]
            if not rows.any():
                break
            edges = np.flatnonzero(np.diff(np.concatenate(([0], rows.astype(int), [0]))))
            lengths = y[edges[1::2]] - y[edges[::2]]
            k = int(lengths.argmax())
            area = float(lengths[k] * (x[b + 1] - x[a]))
            if area > best:
                best, corners = area, np.array(((x[a], y[edges[2 * k]]), (x[b + 1], y[edges[2 * k + 1]])))
    return best, corners
