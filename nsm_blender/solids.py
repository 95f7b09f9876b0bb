"""Meshes in a character's own metres: read once, cached by what they hold, and placed as often as they are shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nsm_core.rotations import Array, heading_quat, quat_to_matrix
from nsm_core.sensors.reading import Reading, Readings, digest, parted

from .evaluated import Seen, require_finite
from .scene import WorldFrame

READINGS = Readings()
# Copies that a scene's objects make of a mesh are grass, leaves and pebbles, and no obstacles, where they are smaller than this
# in every way, or thinner than this in two and no longer than a knee is high, metres.
_PEBBLE, _BLADE, _KNEE = 0.12, 0.03, 0.5
# Sizes of one mesh between two of which one reading serves: factors of the fourth root of two.
_SIZES = 4


@dataclass(frozen=True)
class Solid:
    """One mesh placed in the core's frame: its reading, turned by ``turn`` (3, 3), as large as ``size``, at ``origin`` (3,).

    ``owner`` is the full name of the object that it belongs to.
    """

    owner: str
    reading: Reading
    turn: Array
    size: float
    origin: Array

    @cached_property
    def vertices(self) -> Array:
        """Corners (V, 3) float64, core frame."""
        return self.size * (self.reading.vertices @ self.turn.T) + self.origin

    @property
    def triangles(self) -> Array:
        """Faces (F, 3), outward as modelled."""
        return self.reading.triangles

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Corners (3,), (3,) of the upright box around it, core frame."""
        low, high = self.reading.low, self.reading.high
        middle = self.size * (self.turn @ ((low + high) / 2)) + self.origin
        half = self.size * (np.abs(self.turn) @ ((high - low) / 2))
        return middle - half, middle + half

    def at(self, points: Array) -> Array:
        """Codes (N,) of the reading at points (N, 3), core frame."""
        return self.reading.codes(points @ self._to_cells - self._first)

    @cached_property
    def _to_cells(self) -> Array:
        return (self.turn / self.size / self.reading.cell).astype(np.float32)

    @cached_property
    def _first(self) -> Array:
        return (self.origin @ (self.turn / self.size / self.reading.cell) + self.reading.low / self.reading.cell).astype(np.float32)

    def seen_from(self, pose: Array) -> Solid:
        """The same in a frame that stands upright at ``pose`` (4,): x, y, z and heading."""
        back = quat_to_matrix(heading_quat(np.array(-float(pose[3]))))
        return Solid(self.owner, self.reading, back @ self.turn, self.size, back @ (self.origin - np.asarray(pose[:3], dtype=np.float64)))

    @classmethod
    def of(cls, vertices: Array, triangles: Array, owner: str = "") -> Solid:
        """Read vertices (V, 3), metres, and triangles (F, 3); GeometryError where they make no mesh."""
        vertices = np.asarray(vertices)
        reading = READINGS.get((digest(vertices, np.asarray(triangles)),), lambda: Reading.of(vertices, triangles))
        return cls(owner, reading, np.eye(3), 1.0, np.zeros(3))


def solids_of(seen: Sequence[Seen], frame: WorldFrame, said: Callable[[float], None] = lambda _: None) -> list[Solid]:
    """Read what is seen in the core's ``frame``; ``said`` hears how far it is, 0..1.

    Raises GeometryError that names the object on coordinates that are not finite.
    """
    if not seen:
        return []
    matrices = np.stack([s.matrix for s in seen])
    matrices[:, :3, 3] -= (0, 0, frame.floor)
    matrices[:, :3] /= frame.scale
    for s, matrix in zip(seen, matrices, strict=True):
        require_finite(matrix, s.owner)
    turns, sizes, stretches = parted(matrices)
    steps = np.ceil(_SIZES * np.log2(sizes) - 1e-5)
    found: dict[tuple, Reading] = {}
    out = []
    for i, s in enumerate(seen):
        key = (s.mesh.digest, int(steps[i]), *np.round(stretches[i].ravel(), 6).tolist())
        whole = float(2 ** (steps[i] / _SIZES))
        if key not in found:
            found[key] = READINGS.get(key, lambda s=s, i=i, whole=whole: _read(s, whole * stretches[i]))  # type: ignore[misc]
            said(i / len(seen))
        out.append(Solid(s.owner, found[key], turns[i], float(sizes[i]) / whole, matrices[i, :3, 3].copy()))
    return out


def _read(seen: Seen, linear: Array) -> Reading:
    vertices, triangles = seen.mesh.faces
    with np.errstate(invalid="ignore", over="ignore"):
        vertices = vertices.astype(np.float64) @ linear.T
    require_finite(vertices, seen.owner)
    return Reading.of(vertices, triangles[:, ::-1] if np.linalg.det(linear) < 0 else triangles)


def is_litter(solid: Solid) -> bool:
    """Whether a copy is as small as grass, leaves or pebbles are."""
    _, middle, longest = sorted((solid.size * solid.reading.cell * solid.reading.code.shape).tolist())
    return longest < _PEBBLE or (middle < _BLADE and longest < _KNEE)
