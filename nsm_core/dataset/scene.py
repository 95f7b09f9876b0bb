"""Furnish the scene of a composed take around the path that was walked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import furniture
from ..conventions import SIT
from ..evaluation.metrics import penetration_depths
from ..rotations import Array, rotate_planar
from .take import Placed, Take

if TYPE_CHECKING:
    from .session import Session

OBSTACLES = ("table", "desk", "cabinet", "box", "chair", "armchair", "sofa", "wall", "stool", "table")
BODY_RADIUS = 0.36  # metres that the walked path keeps from furniture


def furnish(take: Take, roots: Array, session: Session, rng: np.random.Generator) -> None:
    """Put furniture about the walked path (T, 2), never on it, preferably inside the detours; changes the take."""
    busy = [(t.track(len(take))[0, :2], 0.5 * float(np.linalg.norm(t.furniture.size[:2]))) for t in take.things]
    busy += [(t.poses[-1, :2], 0.5 * float(np.linalg.norm(t.furniture.size[:2]))) for t in take.things if t.moves]
    busy += [(o.position, 0.5 * float(np.linalg.norm(o.furniture.size[:2]))) for o in take.obstacles]
    busy += [(place, 0.6) for e in session.episodes for place, _ in e.places]

    def try_put(spot: Array, kind: str) -> None:
        piece = session.draw(kind, rng)
        heading = float(rng.uniform(-np.pi, np.pi))
        local = rotate_planar(roots - spot, np.full(len(roots), -heading))
        lo, hi = piece.mins[:, :2].min(0), piece.maxs[:, :2].max(0)
        outside = np.maximum(np.maximum(lo - local, local - hi), 0)
        if np.linalg.norm(outside, axis=1).min() < BODY_RADIUS:
            return
        radius = 0.5 * float(np.linalg.norm(piece.size[:2]))
        if any(np.linalg.norm(p - spot) < r + radius for p, r in busy):
            return
        busy.append((spot, radius))
        take.obstacles.append(Placed(piece, spot, heading))

    for middle in session.detours:
        for _ in range(3):
            try_put(middle + rng.normal(0, 0.12, 2), str(rng.choice(("table", "box", "cabinet", "chair", "stool", "desk"))))
    for _ in range(int(rng.integers(0, 26))):
        at = roots[rng.integers(len(roots))]
        angle = rng.uniform(-np.pi, np.pi)
        try_put(at + rng.uniform(0.5, 2.4) * np.array((np.cos(angle), np.sin(angle))), str(rng.choice(OBSTACLES)))


def keep_clear(take: Take, fixed: int = 0, seat_depth: float = 0.09, depth: float = 0.05) -> bool:
    """Take away obstacles that the body enters deeper than ``depth``, metres; False where a seat is walked into.

    The first ``fixed`` obstacles belong to episodes and stay: False where one is entered deeper than ``seat_depth``.  Calves brush a seat's edge in the turn before
    it, hence the allowance ``seat_depth``.
    """
    kept = take.obstacles[:fixed]
    own = furniture.cuboids([(o.furniture, o.position, o.heading) for o in kept])
    if kept and penetration_depths(take.hips[::2], take.rotations[::2], own).max() > seat_depth:
        return False
    for o in take.obstacles[fixed:]:
        if penetration_depths(take.hips[::2], take.rotations[::2], furniture.cuboids([(o.furniture, o.position, o.heading)])).max() < depth:
            kept.append(o)
    take.obstacles = kept
    standing = take.labels[:, SIT] < 0.3
    seats = [(t.furniture, t.poses[:3], float(t.poses[3])) for t in take.things if t.furniture.seat is not None and not t.moves]
    if not seats or not standing.any():
        return True
    return bool(penetration_depths(take.hips[standing], take.rotations[standing], furniture.cuboids(seats)).max() < seat_depth)
