"""What is read of a mesh once, however often and wherever it stands: its faces, their sides, and where it is
solid.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np

from nsm_core.rotations import Array

from .orientation import face_sides
from .triangles import check_mesh, thin_out
from .voxels import voxelise

# Dense meshes are thinned to cells of this size, metres, and the densest to the second: no distance changes
# by more than their diagonals, 5 and 10 mm, and that only where a mesh is not flat.
FINEST, SECOND, _DENSEST = 0.003, 0.006, 120_000
_ROOM = (1.0, 1.0, 1.5)  # metres: in a mesh larger than this every way a character may stand
_MOST_BYTES = 400_000_000
_RIM = 1e-3  # of a cell: rounding may put what lies in the outermost faces so far outside


@dataclass(frozen=True)
class Reading:
    """A mesh in an upright frame of its own, metres.

    ``vertices`` (V, 3) float64, ``triangles`` (F, 3), ``sides`` (F,) int8 as ``face_sides`` tells them; and a
    grid over its bounding box from ``low`` (3,) with cells ``cell`` (3,) of ``code`` (X, Y, Z): 0 free, 1 on
    the surface, 2 inside.  In ``kept`` who uses it may keep what he makes of it.
    """

    vertices: Array
    triangles: Array
    sides: Array
    low: Array
    cell: Array
    code: Array
    kept: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)

    @classmethod
    def of(cls, vertices: Array, triangles: Array) -> Reading:
        """Read a mesh: vertices (V, 3) metres, Z up, and triangles (F, 3).  Raises GeometryError as
        ``check_mesh`` does.
        """
        vertices, triangles = thin_out(*check_mesh(vertices, triangles), FINEST)
        vertices, triangles = thin_out(vertices, triangles, SECOND, _DENSEST)
        grid, sides = voxelise(vertices, triangles), face_sides(vertices, triangles)
        if (np.ptp(vertices, axis=0) > _ROOM).all():
            sides = np.zeros_like(sides)  # maybe a closed room with the character inside
        code = np.where(grid.surface, 1, np.where(grid.solid, 2, 0)).astype(np.int8)
        return cls(vertices, triangles, sides, grid.origin, grid.cell, code)

    @property
    def high(self) -> Array:
        """Greatest corner (3,) of the bounding box."""
        return self.low + self.cell * self.code.shape

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        return self.vertices.nbytes + self.triangles.nbytes + self.sides.nbytes + self.code.nbytes

    def codes(self, cells: Array) -> Array:
        """Codes (N,) at places (N, 3) counted in cells from ``low``; 0 outside the grid, whose faces belong
        to it.
        """
        shape = self.code.shape
        index = cells.astype(np.int64)
        flat = np.zeros(len(index), np.int64)
        inside = np.ones(len(index), bool)
        for column, place, count in zip(index.T, cells.T, shape, strict=True):
            inside &= (place > -_RIM) & (place < count + _RIM)
            flat *= count
            flat += np.minimum(np.maximum(column, 0), count - 1)
        return np.where(inside, self.code.reshape(-1)[flat], 0)


class Readings:
    """Readings kept for the next take, by what the mesh holds; those not used for longest go first."""

    def __init__(self, most_bytes: int = _MOST_BYTES) -> None:
        self._kept: OrderedDict[tuple[Any, ...], Reading] = OrderedDict()
        self._bytes, self._most, self._lock = 0, most_bytes, Lock()

    def get(self, key: tuple[Any, ...], read: Callable[[], Reading]) -> Reading:
        """The reading of that key, made by ``read`` where there is none."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        made = read()
        with self._lock:
            if key not in self._kept:
                self._kept[key] = made
                self._bytes += made.nbytes
            while self._bytes > self._most and len(self._kept) > 1:
                self._bytes -= self._kept.popitem(last=False)[1].nbytes
        return made

    def clear(self) -> None:
        """Forget all."""
        with self._lock:
            self._kept.clear()
            self._bytes = 0

    def __len__(self) -> int:
        return len(self._kept)


def digest(*arrays: Array) -> bytes:
    """A short name (16 bytes) for what arrays hold."""
    made = hashlib.blake2b(digest_size=16)
    for array in arrays:
        made.update(str((array.shape, array.dtype)).encode())
        made.update(np.ascontiguousarray(array).data)
    return made.digest()


def parted(matrices: Array) -> tuple[Array, Array, Array]:
    """Part affine maps (N, 4, 4) into a rotation, a size and what is left: turns (N, 3, 3), sizes (N,),
    stretches (N, 3, 3).

    A point p goes to ``turn @ (size * stretch @ p) + translation``.  The turn's Z is the axis of the
    stretched mesh that points up or down, so that it stands upright as far as that can be; a mirror image and
    all unevenness is in the stretch, whose determinant is 1 or -1.  Copies of a mesh that are turned, moved
    and evenly scaled so have one stretch.
    """
    linear = np.asarray(matrices, dtype=np.float64)[:, :3, :3]
    u, s, vt = np.linalg.svd(linear)
    turn = u @ vt
    stretch = np.swapaxes(vt, 1, 2) @ (s[:, :, None] * vt)
    mirrored = np.linalg.det(turn) < 0
    turn[mirrored], stretch[mirrored] = -turn[mirrored], -stretch[mirrored]
    size = np.cbrt(np.abs(np.linalg.det(stretch)))
    size = np.where(size > 1e-9, size, 1.0)
    stretch = stretch / size[:, None, None]
    # The axis that is most upright becomes Z, by turning the axes in a ring.  The hair decides ties alike.
    up = (np.abs(turn[:, 2]) + (0, 1e-6, 2e-6)).argmax(1)
    ring = (np.arange(3) + up[:, None] + 1) % 3
    turn = np.take_along_axis(turn, ring[:, None, :], 2)
    stretch = np.take_along_axis(stretch, ring[:, :, None], 1)
    return turn, size, stretch
