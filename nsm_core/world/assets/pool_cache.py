"""What a pool of meshes holds, and the file that keeps it, since meshes take long to convert."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from nsm_core.errors import OutputError
from nsm_core.files import atomic_path
from nsm_core.world.scene.furniture import Furniture, box_mesh
from nsm_core.world.scene.furniture.piece import Seat

from .door_from_mesh import LIMITS


@dataclass(frozen=True)
class Entry:
    """A piece of the pool: its file's ``name``, class in the index, furniture kind, and whether it is held
    back.
    """

    name: str
    group: str
    piece: Furniture
    held: bool = False


@dataclass(frozen=True)
class DoorEntry:
    """A door of the pool: its file's ``name``, its measures (see ``door.make_door``), and whether it is held
    back.
    """

    name: str
    measures: dict[str, float]
    held: bool = False


class PoolContent(NamedTuple):
    """Pieces, meshes that are none (name, class, reason), and doors."""

    entries: list[Entry]
    rejected: list[tuple[str, str, str]]
    doors: list[DoorEntry]


VERSION = 3  # of the conversion; another number makes all caches stale
_LARGEST_CACHE = 1 << 28  # bytes


def write_cache(path: Path, stamp: str, pool: PoolContent) -> None:
    """Write what a pool holds, under the ``stamp`` of what it was read from; OutputError where that cannot be
    done.
    """
    seats = [e.piece.seat for e in pool.entries]
    content = dict(
        stamp=stamp,
        entries=np.array([(e.name, e.group, e.piece.kind) for e in pool.entries]).reshape(-1, 3),
        held=np.array([e.held for e in pool.entries]),
        counts=np.array([len(e.piece.mins) for e in pool.entries], dtype=int),
        boxes=np.concatenate(
            [np.concatenate((e.piece.mins, e.piece.maxs), 1) for e in pool.entries] or [np.zeros((0, 6))]
        ),
        seats=np.array(
            [(*s.point, s.height, s.width, s.depth, s.back, s.arms) if s else (np.nan,) * 8 for s in seats]
        ).reshape(-1, 8),
        openings=np.array([e.piece.opening or (np.nan,) * 3 for e in pool.entries]).reshape(-1, 3),
        doors=np.array([(d.name, d.held) for d in pool.doors], dtype=str).reshape(-1, 2),
        measures=np.array([[d.measures[k] for k in LIMITS] for d in pool.doors]).reshape(-1, len(LIMITS)),
        rejected=np.array(pool.rejected, dtype=str).reshape(-1, 3),
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, **content)
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}); name another --cache.") from error


def read_cache(path: Path, stamp: str) -> PoolContent | None:
    """What a cache holds, None where there is none for this index; a damaged one is made anew."""
    try:
        return _cached(path, stamp) if path.is_file() and path.stat().st_size < _LARGEST_CACHE else None
    except Exception:  # whatever is wrong with it, the meshes are there to be read again
        return None


def _cached(path: Path, stamp: str) -> PoolContent | None:
    with np.load(path) as f:
        if str(f["stamp"]) != stamp:
            return None
        doors = [
            DoorEntry(str(name), dict(zip(LIMITS, map(float, m), strict=True)), str(held) == "True")
            for (name, held), m in zip(f["doors"], f["measures"], strict=True)
        ]
        ends = np.cumsum(f["counts"])
        rejected = [(str(n), str(c), str(why)) for n, c, why in f["rejected"]]
        pool = PoolContent([], rejected, doors)
        rows = zip(
            f["entries"],
            f["held"],
            np.split(f["boxes"].astype(np.float32), ends[:-1]),
            f["seats"],
            f["openings"],
            strict=True,
        )
        for (name, group, kind), held, boxes, s, opening in rows if len(ends) else ():
            seat, gap = None, None
            if not np.isnan(s[0]):
                height, width, depth = (float(v) for v in s[3:6])
                seat = Seat(s[:3].astype(np.float32), 0.0, height, width, depth, bool(s[6]), bool(s[7]))
            if not np.isnan(opening[0]):
                left, right, top = (float(v) for v in opening)
                gap = (left, right, top)
            piece = Furniture(
                str(kind), *box_mesh(boxes[:, :3], boxes[:, 3:]), boxes[:, :3], boxes[:, 3:], seat, gap
            )
            pool.entries.append(Entry(str(name), str(group), piece, bool(held)))
    return pool
