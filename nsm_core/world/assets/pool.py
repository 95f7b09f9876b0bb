"""The object pool of the augmentation: furniture meshes and parametric pieces, drawn by kind at random
scales.

A pool folder has an ``index.csv`` with the columns file, class and, optionally, front and scale; its GLB
files are Y up, front +Z. Some pieces of every class are held back for testing, by name, so that it is the
same ones on every machine.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.distances import CRATE_SIDE, SEATS_DRAWN
from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.validate import read_bytes, read_csv, shown
from nsm_core.world.scene import furniture
from nsm_core.world.scene.door import Door, make_door
from nsm_core.world.scene.furniture import SEAT_KINDS, Furniture, box_mesh

from .door_from_mesh import LIMITS, door_measures
from .from_mesh import piece_of
from .glb import joined, read_parts
from .pool_cache import VERSION, DoorEntry, Entry, PoolContent, read_cache, write_cache

# Kinds of furniture by the classes of an index; anything else is left out.
KIND_OF = {
    "chair": "chair",
    "armchair": "armchair",
    "sofa": "sofa",
    "stool": "stool",
    "bench": "bench",
    "table": "table",
    "desk": "desk",
    "cabinet": "cabinet",
    "drawer": "cabinet",
    "shelf": "shelf",
    "box": "box",
    "wall": "wall",
}
# Random scales along x, y and z (papers/000 section 5.2 gives none; these are those of its published objects,
# narrowed for meshes that are large already).
SCALES = {
    "chair": ((1, 1), (1, 1), (0.7, 1.3)),
    "armchair": ((0.75, 1.3), (0.9, 1.1), (0.75, 1.25)),
    "sofa": ((0.75, 1.25), (0.9, 1.1), (0.8, 1.25)),
    "stool": ((0.85, 1.2), (0.85, 1.2), (0.7, 1.3)),
    "bench": ((0.8, 1.4), (0.9, 1.15), (0.75, 1.25)),
    "table": ((0.5, 1), (0.6, 1), (0.67, 1.33)),
    "desk": ((0.6, 1), (0.75, 1), (0.67, 1.33)),
    "cabinet": ((0.7, 1.3), (0.8, 1.2), (0.7, 1.3)),
    "shelf": ((0.7, 1.3), (0.8, 1.2), (0.7, 1.2)),
    "box": ((0.75, 1), (0.75, 1), (0.67, 1.5)),
    "wall": ((0.7, 1.6), (0.8, 1.2), (0.9, 1.1)),
    "hole_wall": ((0.95, 1.25), (0.6, 1), (0.98, 1.05)),
}
_FLATTEST_BOX = 0.12  # lids and trays are no boxes, metres
SCALE_RANGE = (1e-4, 1e4)  # of a row of the index: millimetres to kilometres
MESH_SHARE = 0.5  # of the draws where there are both meshes and parametric pieces


@dataclass
class Pool:
    """Pieces and doors to draw from.  ``rejected`` tells why a mesh is not among them; ``mesh_share`` how
    often a mesh is drawn at all.

    A pool without entries draws parametric pieces alone.
    """

    entries: list[Entry] = field(default_factory=list)
    rejected: list[tuple[str, str, str]] = field(default_factory=list)  # name, class, reason
    mesh_share: float = MESH_SHARE
    doors: list[DoorEntry] = field(default_factory=list)

    @classmethod
    def load(cls, folder: str | Path, held_back: float = 0.2, cache: str | Path | None = None) -> Pool:
        """Read a pool folder, through the ``cache`` (.npz) where that was written from the same index.

        At least the share ``held_back`` of the pieces of every class and kind is held back.  Raises
        GeometryError where the folder has no index; ModuleNotFoundError where trimesh is missing and the
        cache does not serve.
        """
        index = Path(folder) / "index.csv"
        if not index.is_file():
            raise GeometryError(f"The object pool {folder} has no index.csv; give the folder that holds it.")
        stamp = hashlib.sha256(
            read_bytes(index, GeometryError) + repr((VERSION, held_back)).encode()
        ).hexdigest()
        if cache is not None and (kept := read_cache(Path(cache), stamp)) is not None:
            return cls(kept.entries, kept.rejected, doors=kept.doors)
        pool = cls()
        for row in read_csv(index, GeometryError, ("file", "class"), "add them, one row for each mesh"):
            name, group = row["file"], row["class"]
            if group not in KIND_OF and group != "door":
                continue
            try:
                factor = _scale(row.get("scale") or "1")
                parts = [(part, v * factor, f) for part, v, f in read_parts(Path(folder) / name)]
                if group == "door":
                    pool.doors.append(DoorEntry(name, door_measures(parts)))
                else:
                    pool.entries.append(Entry(name, group, _convert(parts, Path(folder) / name, row)))
            except GeometryError as error:
                pool.rejected.append((name, group, str(error)))
        pool.entries = hold_back(pool.entries, held_back)
        held = first_names([d.name for d in pool.doors], held_back)
        twins = [d.measures for d in pool.doors if d.name in held]
        pool.doors = [replace(d, held=d.measures in twins) for d in pool.doors]
        if cache is not None:
            write_cache(Path(cache), stamp, PoolContent(pool.entries, pool.rejected, pool.doors))
        return pool

    def training(self) -> Pool:
        """Return the pool of the pieces that may be trained on, with parametric pieces mixed in."""
        return self._only(False)

    def held_back(self) -> Pool:
        """Return the pool of the pieces held back; it draws meshes alone where it has some of a kind."""
        return replace(self._only(True), mesh_share=1.0)

    def _only(self, held: bool) -> Pool:
        return replace(
            self,
            entries=[e for e in self.entries if e.held == held],
            doors=[d for d in self.doors if d.held == held],
        )

    def of_kind(self, kind: str) -> list[Entry]:
        """Entries that serve as furniture of ``kind``: crates are made of boxes."""
        return [e for e in self.entries if e.piece.kind == ("box" if kind == "crate" else kind)]

    def draw(self, kind: str, rng: np.random.Generator, augment: bool = True) -> Furniture:
        """Draw a piece of ``kind`` (one of ``furniture.KINDS``); the same draws of ``rng`` give the same
        piece.

        Meshes are scaled at random with ``augment``; seats stay within ``SEATS_DRAWN``, crates within
        ``CRATE_SIDE``.  Draws from all entries: call it on ``training()`` or ``held_back()``.
        """
        choice = self.of_kind(kind)
        if rng.random() >= self.mesh_share or not choice:
            return furniture.make(kind, rng)
        piece = choice[int(rng.integers(len(choice)))].piece
        if kind == "crate":
            return scaled(piece, rng.uniform(*CRATE_SIDE, 3) / piece.size, kind)
        return scaled(piece, random_scale(piece, rng), kind) if augment else piece

    def door_like(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw the measures of a mesh's door (see ``door.make_door``), up to 8 % larger or smaller; none for
        a parametric door.
        """
        if rng.random() >= self.mesh_share or not self.doors:
            return {}
        measures = dict(self.doors[int(rng.integers(len(self.doors)))].measures)
        for name in ("width", "height", "handle_height"):
            measures[name] = float(np.clip(measures[name] * rng.uniform(0.92, 1.08), *LIMITS[name]))
        return measures

    def draw_door(self, rng: np.random.Generator, **walls: float) -> Door:
        """Draw a door like a mesh's or a parametric one; ``walls`` are measures of what is around it (see
        ``door.make_door``).
        """
        return make_door(rng, **self.door_like(rng) | walls)

    def table(self) -> str:
        """Count the pieces by class and kind, training and held back, and the reasons of what was left out,
        as text.
        """
        groups = sorted({(e.group, e.piece.kind) for e in self.entries})
        lines = [f"{'class':10s}{'kind':11s}{'training':>9s}{'held back':>10s}{'boxes':>7s}"]
        for group, kind in groups:
            of = [e for e in self.entries if (e.group, e.piece.kind) == (group, kind)]
            held, boxes = sum(e.held for e in of), np.mean([len(e.piece.mins) for e in of])
            lines.append(f"{group:10s}{kind:11s}{len(of) - held:9d}{held:10d}{boxes:7.1f}")
        held = sum(d.held for d in self.doors)
        if self.doors:
            lines.append(f"{'door':10s}{'door':11s}{len(self.doors) - held:9d}{held:10d}")
        held = sum(e.held for e in self.entries)
        lines.append(f"{'all furniture':21s}{len(self.entries) - held:9d}{held:10d}")
        return "\n".join(lines + [f"left out: {name} ({reason})" for name, _, reason in self.rejected])


def random_scale(piece: Furniture, rng: np.random.Generator) -> Array:
    """Draw factors (3,) along x, y and z of a piece by its kind; a seat keeps a height people sit at."""
    ranges = [(float(low), float(high)) for low, high in SCALES.get(piece.kind, ((1, 1),) * 3)]
    if piece.seat is not None:
        low, high = (limit / piece.seat.height for limit in SEATS_DRAWN)
        a, b = ranges[2]
        ranges[2] = (max(a, low), min(b, high))
        if ranges[2][0] > ranges[2][1]:  # no scale of the kind does: the nearest that gives a seat
            ranges[2] = (low, low) if low > b else (high, high)
    return np.array([rng.uniform(low, high) for low, high in ranges])


def scaled(piece: Furniture, factors: ArrayLike, kind: str | None = None) -> Furniture:
    """Return a piece scaled by ``factors`` (3,) about its origin, seat (which faces -Y) and opening
    included.
    """
    f = np.asarray(factors, dtype=np.float64)
    mins, maxs = ((a * f).astype(np.float32) for a in (piece.mins, piece.maxs))
    seat, opening = piece.seat, piece.opening
    if seat is not None:
        point = (seat.point * f).astype(np.float32)
        seat = replace(
            seat,
            point=point,
            height=float(point[2]),
            width=float(seat.width * f[0]),
            depth=float(seat.depth * f[1]),
        )
    if opening is not None:
        opening = (opening[0] * f[0], opening[1] * f[0], opening[2] * f[2])
    return Furniture(kind or piece.kind, *box_mesh(mins, maxs), mins, maxs, seat, opening)


def hold_back(entries: Iterable[Entry], held_back: float) -> list[Entry]:
    """Hold back at least the share ``held_back`` of every class and kind, by the hash of the names, and what
    has the same shape.
    """
    entries = list(entries)
    held: set[str] = set()
    for key in {(e.group, e.piece.kind) for e in entries}:
        held |= first_names([e.name for e in entries if (e.group, e.piece.kind) == key], held_back)
    shapes = {_shape(e.piece) for e in entries if e.name in held}
    return [replace(e, held=_shape(e.piece) in shapes) for e in entries]


def _shape(piece: Furniture) -> bytes:
    return np.round(np.concatenate((piece.mins, piece.maxs)), 2).tobytes()


def first_names(names: list[str], share: float) -> set[str]:
    """Choose at least a ``share`` of names by their hashes: the same ones everywhere, whatever their
    order.
    """
    ordered = sorted(names, key=lambda name: hashlib.sha256(Path(name).stem.encode()).hexdigest())
    return set(ordered[: int(np.ceil(share * len(names) - 1e-9))])


def _scale(said: str) -> float:
    """The scale of a row of the index."""
    try:
        factor = float(said.replace(",", "."))
    except ValueError:
        factor = np.nan
    if not SCALE_RANGE[0] <= factor <= SCALE_RANGE[1]:
        raise GeometryError(
            f"Its scale is {shown(said)}; write a number from {SCALE_RANGE[0]:g} to {SCALE_RANGE[1]:g} into "
            "the index."
        )
    return factor


def _convert(parts: list[Any], path: Path, row: dict[str, str]) -> Furniture:
    vertices, triangles = joined(parts)
    kind = KIND_OF[row["class"]]
    if kind == "table" and "desk" in path.stem.lower():
        kind = "desk"
    size = np.ptp(vertices, axis=0)
    if kind == "box" and size.min() < _FLATTEST_BOX:
        raise GeometryError(f"It is only {size.min():.2f} m thick; choose boxes.")
    if not 0.15 < size.max() < 4.5:
        raise GeometryError(f"It measures {size.max():.2f} m; give it a scale in the index.")
    piece = piece_of(vertices, triangles, kind, kind in SEAT_KINDS, (row.get("front") or "+Z") == "+Z")
    if piece.opening is not None:
        piece.kind = "hole_wall"
    return piece
