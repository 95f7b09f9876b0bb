"""Turn furniture meshes of any quality into pieces made of few boxes."""

from __future__ import annotations

import numpy as np

from nsm_core.distances import SEATS_SCALABLE
from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.affordances.seat import find_seat
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.geometry.voxels import VoxelGrid, merge, voxelise
from nsm_core.world.scene.furniture import Furniture, box_mesh, top_of
from nsm_core.world.scene.furniture.piece import Seat, hip_setback

FINE = 0.02  # metres: what boxes shrink to
MOST_BOXES = 40
_COARSER = (2, 3, 4, 5, 6, 8, 10)  # fine voxels in one that is merged, until few boxes are left
_PATCH = (0.14, 0.18)  # half width and reach before the hips of the place that a sitter covers, metres
_HEADROOM = np.array([(x, y, z) for x in (-0.1, 0, 0.1) for y in (-0.1, 0) for z in (0.04, 0.3, 0.6)])
_FEET = np.array([(x, y, z) for x in (-0.12, 0.12) for y in (-0.3, -0.1) for z in (0.05, 0.25)])
OPENING = (0.7, 2.2, 1.9)  # least and greatest width and least height of an opening to walk through, metres


def boxes_of(vertices: Array, triangles: Array, most: int = MOST_BOXES) -> tuple[Array, Array]:
    """Cover a mesh by at most about ``most`` boxes: mins, maxs (M, 3) metres, frame of the mesh.

    ``vertices`` (V, 3) metres, ``triangles`` (F, 3).  Voxels are merged as for a collider, the coarser the
    more detail there is; then every box shrinks to the fine voxels inside it, so that thin legs stay thin.
    """
    fine = voxelise(vertices, triangles, FINE)
    for factor in _COARSER:
        pad = [(0, -n % factor) for n in fine.solid.shape]
        solid = np.pad(fine.solid, pad)
        blocks = solid.reshape([k for n in solid.shape for k in (n // factor, factor)])
        coarse = blocks.any((1, 3, 5))
        unit = VoxelGrid(np.zeros(3), np.ones(3), coarse, coarse)
        mins, maxs = (a.astype(int) * factor for a in merge(unit))
        if len(mins) <= most:
            break
    for k, (a, b) in enumerate(zip(mins, maxs, strict=True)):
        filled = np.argwhere(solid[a[0] : b[0], a[1] : b[1], a[2] : b[2]])
        mins[k], maxs[k] = a + filled.min(0), a + filled.max(0) + 1
    return fine.origin + mins * fine.cell, fine.origin + maxs * fine.cell


def piece_of(vertices: Array, triangles: Array, kind: str, sits: bool, front_known: bool = True) -> Furniture:
    """Make a piece of furniture of a mesh.

    ``vertices`` (V, 3) metres, Z up, front -Y; ``triangles`` (F, 3).  ``sits`` asks for a seat; where the
    front of such a mesh is not known it is turned so that a sitter faces -Y.  The piece stands on the floor
    at its footprint's centre.  Raises GeometryError where no seat is found, it faces another way than the
    front, or there is no room for a sitter.
    """
    vertices = _stand(np.asarray(vertices, dtype=np.float64))
    seat = None
    if sits:
        seat = find_seat(vertices, triangles)
        if front_known and abs(wrap_angle(seat.heading)) > np.radians(30):
            raise GeometryError(
                f"The seat faces {np.degrees(seat.heading):.0f} degrees away from the front; turn the mesh."
            )
        if abs(seat.heading) > 1e-3:
            vertices = _stand(rotate_planar(vertices, np.float64(-seat.heading)))
            seat = find_seat(vertices, triangles)
            if abs(wrap_angle(seat.heading)) > np.radians(10):
                raise GeometryError("It is unclear which way one sits on it; choose another mesh.")
            seat.heading = 0.0
        if not SEATS_SCALABLE[0] <= seat.height <= SEATS_SCALABLE[1]:
            raise GeometryError(f"The seat lies {seat.height:.2f} m high; scale the mesh.")
    mins, maxs = boxes_of(vertices, triangles)
    if seat is not None:
        mins, maxs = _even_seat(mins, maxs, seat)
        query = Cuboids([((0, 0), 0.0, mins, maxs)])
        feet = seat.point * (1, 1, 0) - (0, hip_setback(seat.depth), 0) + _FEET
        if (query.signed_distance(seat.point + _HEADROOM, 1.0) <= 0).any() or (
            query.signed_distance(feet, 1.0) <= 0
        ).any():
            raise GeometryError(
                "Something stands in the way over the seat or before it; choose another mesh."
            )
    mins, maxs = mins.astype(np.float32), maxs.astype(np.float32)
    piece = Furniture(kind, *box_mesh(mins, maxs), mins, maxs, seat)
    if kind in ("wall", "hole_wall"):
        piece.opening = opening_of(piece)
    elif kind in ("table", "desk"):
        top_of(piece)  # refuses what nothing can be put on
    return piece


def _stand(vertices: Array) -> Array:
    low, high = vertices.min(0), vertices.max(0)
    return vertices - (*((low + high) / 2)[:2], low[2])


def _even_seat(mins: Array, maxs: Array, seat: Seat) -> tuple[Array, Array]:
    """Bring the boxes under a sitter exactly to the height of the seat: voxels are up to one too high."""
    half, ahead = _PATCH
    x, y, h = seat.point[0], seat.point[1], float(seat.height)
    under = (
        (mins[:, 0] < x + half)
        & (maxs[:, 0] > x - half)
        & (mins[:, 1] < y + half / 2)
        & (maxs[:, 1] > y - ahead)
    )
    near = under & (np.abs(maxs[:, 2] - h) < 0.09)
    keep = ~(near & (mins[:, 2] >= h - 0.005))
    maxs = maxs.copy()
    maxs[near, 2] = h
    return mins[keep], maxs[keep]


def opening_of(piece: Furniture) -> tuple[float, float, float] | None:
    """Find the widest opening that a person walks through along X: x0, x1 and height, metres; None where
    there is none.
    """
    edges = np.unique(np.round(np.concatenate((piece.mins[:, 0], piece.maxs[:, 0])), 3))
    middle = (edges[1:] + edges[:-1]) / 2
    covers = (piece.mins[:, 0, None] < middle) & (middle < piece.maxs[:, 0, None])
    # What lies as low as a sill does not hinder.
    low = np.where(covers & (piece.maxs[:, 2, None] > 0.03), piece.mins[:, 2, None], np.inf).min(0)
    free = low >= OPENING[2]
    runs = np.flatnonzero(np.diff(np.concatenate(([0], free.astype(int), [0]))))
    found = [(edges[a], edges[b], low[a:b].min()) for a, b in zip(runs[::2], runs[1::2], strict=True)]
    fitting = [f for f in found if OPENING[0] <= f[1] - f[0] <= OPENING[1] and np.isfinite(f[2])]
    if not fitting:
        return None
    left, right, height = max(fitting, key=lambda f: f[1] - f[0])
    return float(left), float(right), float(height)
