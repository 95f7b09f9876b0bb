"""Meshes in a character's own metres: read once, cached by what they hold, and placed as often as they are
shown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nsm_core.rotations import Array, heading_quat, quat_to_matrix
from nsm_core.world.geometry.mesh_reading import Reading, Readings, digest, parted

from .evaluated import Seen, require_finite
from .frame import WorldFrame

READINGS = Readings()
# Copies that a scene's objects make of a mesh are grass, leaves and pebbles, and no obstacles, where they are
# smaller than this in every way, or thinner than this in two and no longer than a knee is high, metres.
_PEBBLE, _BLADE, _KNEE = 0.12, 0.03, 0.5
# Sizes of one mesh between two of which one reading serves: factors of the fourth root of two.
_SIZES = 4


@dataclass(frozen=True)
class Solid:
    """One mesh placed in the core's frame: its reading, turned by ``turn`` (3, 3), as large as ``size``, at
    ``origin`` (3,).

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
        return self._box[:2]

    @cached_property
    def top_at_least(self) -> float:
        """A height that it reaches for certain, core frame; its own where it stands upright."""
        return self._box[2]

    @cached_property
    def _box(self) -> tuple[Array, Array, float]:
        return next(_boxes([self.reading], self.turn[None], np.array([self.size]), self.origin[None]))

    def at(self, points: Array) -> Array:
        """Codes (N,) of the reading at points (N, 3), core frame."""
        return self.reading.codes(points @ self._to_cells - self._first)

    @cached_property
    def _to_cells(self) -> Array:
        return (self.turn / self.size / self.reading.cell).astype(np.float32)

    @cached_property
    def _first(self) -> Array:
        return (
            self.origin @ (self.turn / self.size / self.reading.cell) + self.reading.low / self.reading.cell
        ).astype(np.float32)

    def seen_from(self, pose: Array) -> Solid:
        """The same in a frame that stands upright at ``pose`` (4,): x, y, z and heading."""
        back = quat_to_matrix(heading_quat(np.array(-float(pose[3]))))
        return Solid(
            self.owner,
            self.reading,
            back @ self.turn,
            self.size,
            back @ (self.origin - np.asarray(pose[:3], dtype=np.float64)),
        )

    @classmethod
    def of(cls, vertices: Array, triangles: Array, owner: str = "") -> Solid:
        """Read vertices (V, 3), metres, and triangles (F, 3); GeometryError where they make no mesh."""
        vertices = np.asarray(vertices)
        reading = READINGS.get(
            (digest(vertices, np.asarray(triangles)),), lambda: Reading.of(vertices, triangles)
        )
        return cls(owner, reading, np.eye(3), 1.0, np.zeros(3))


def solids_of(
    seen: Sequence[Seen], frame: WorldFrame, said: Callable[[float], None] = lambda _: None
) -> list[Solid]:
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
    wholes = 2 ** (steps / _SIZES)
    rounded = np.round(stretches.reshape(-1, 9), 6) + 0.0  # no zero below zero
    found: dict[tuple, Reading] = {}
    readings = []
    for i, (s, *key) in enumerate(zip(seen, steps.tolist(), map(bytes, rounded), strict=True)):
        key = (s.mesh.digest, *key)
        if key not in found:
            found[key] = READINGS.get(key, lambda s=s, i=i: _read(s, wholes[i] * stretches[i]))  # type: ignore[misc]
            said(i / len(seen))
        readings.append(found[key])
    sizes, origins = sizes / wholes, matrices[:, :3, 3].copy()
    out = [Solid(s.owner, *of) for s, *of in zip(seen, readings, turns, sizes.tolist(), origins, strict=True)]
    for solid, box in zip(out, _boxes(readings, turns, sizes, origins), strict=True):
        vars(solid)["_box"] = box
    return out


def _boxes(
    readings: Sequence[Reading], turns: Array, sizes: Array, origins: Array
) -> Iterator[tuple[Array, Array, float]]:
    """Lowest and highest corners (3,), (3,) of the boxes around readings so placed (N,), and heights that
    they reach for certain.
    """
    low, high = (np.array([getattr(r, side) for r in readings]) for side in ("low", "high"))
    turns, sizes = turns.astype(np.float64), sizes[:, None]
    middle = sizes * (turns @ ((low + high) / 2)[..., None])[..., 0] + origins
    # Of each of its axes along those of the world.
    reach = sizes[..., None] * np.abs(turns) * ((high - low) / 2)[:, None]
    half = reach.sum(-1)
    # Something touches its end of each axis, at worst where the other two lead lowest.
    tops = middle[:, 2] + (2 * reach[:, 2].max(-1) - half[:, 2])
    return zip(middle - half, middle + half, tops.tolist(), strict=True)


def placed(solids: Sequence[Solid]) -> bytes:
    """A short name for these solids where they are, as long as their readings are kept."""
    if not solids:
        return b""
    return digest(
        np.array([s.turn for s in solids]),
        np.array([s.origin for s in solids]),
        np.array([(id(s.reading), s.size) for s in solids], float),
    )


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
