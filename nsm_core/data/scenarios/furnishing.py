"""Furnish the scene of a composed take around the path that was walked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nsm_core.body.thin_capsules import thin_depths
from nsm_core.conventions import SIT
from nsm_core.rotations import Array, direction_to_heading, rotate_planar
from nsm_core.world.scene import furniture

from .draws import FURNISHINGS
from .take import ComposedTake, Placed

if TYPE_CHECKING:
    from .session import Session


def furnish(take: ComposedTake, roots: Array, session: Session, rng: np.random.Generator) -> None:
    """Put furniture about the walked path (T, 2), never on it, preferably inside the detours; changes the
    take.
    """
    busy = [
        (t.track(len(take))[0, :2], 0.5 * float(np.linalg.norm(t.furniture.size[:2]))) for t in take.things
    ]
    busy += [
        (t.poses[-1, :2], 0.5 * float(np.linalg.norm(t.furniture.size[:2]))) for t in take.things if t.moves
    ]
    busy += [(o.position, 0.5 * float(np.linalg.norm(o.furniture.size[:2]))) for o in take.obstacles]
    busy += [(place, 0.6) for e in session.episodes for place, _ in e.places]

    def try_put(spot: Array, kind: str) -> None:
        piece = session.draw(kind)
        heading = float(rng.uniform(-np.pi, np.pi))
        local = rotate_planar(roots - spot, np.full(len(roots), -heading))
        lo, hi = piece.mins[:, :2].min(0), piece.maxs[:, :2].max(0)
        outside = np.maximum(np.maximum(lo - local, local - hi), 0)
        if np.linalg.norm(outside, axis=1).min() < FURNISHINGS.way_room:
            return
        radius = 0.5 * float(np.linalg.norm(piece.size[:2]))
        if any(np.linalg.norm(p - spot) < r + radius for p, r in busy):
            return
        busy.append((spot, radius))
        take.obstacles.append(Placed(piece, spot, heading))

    if rng.random() < FURNISHINGS.holes:
        _wall_with_a_hole(take, roots, session, rng, busy)
    for middle in session.detours:
        for _ in range(FURNISHINGS.tries_in_detour):
            try_put(
                middle + rng.normal(0, FURNISHINGS.off_detour, 2),
                str(rng.choice(FURNISHINGS.in_detours)),
            )
    for _ in range(int(rng.integers(*FURNISHINGS.pieces))):
        at = roots[rng.integers(len(roots))]
        angle = rng.uniform(-np.pi, np.pi)
        try_put(
            at + rng.uniform(*FURNISHINGS.off_way) * np.array((np.cos(angle), np.sin(angle))),
            str(rng.choice(FURNISHINGS.kinds)),
        )


def _wall_with_a_hole(
    take: ComposedTake,
    roots: Array,
    session: Session,
    rng: np.random.Generator,
    busy: list[tuple[Array, float]],
) -> None:
    """Put a wall across the path so that it leads through its opening, if no other part of the path meets the
    wall.
    """
    step = roots[10:] - roots[:-10]
    moving = np.flatnonzero((np.linalg.norm(step, axis=1) > 0.25) & ~take.rises()[10:])
    for _ in range(FURNISHINGS.tries_of_hole):
        if not len(moving):
            return
        f = int(rng.choice(moving))
        piece = session.draw("hole_wall")
        if piece.opening is None:
            continue
        heading = (
            float(direction_to_heading(step[f]))
            + float(rng.choice((0, np.pi)))
            + float(rng.normal(0, FURNISHINGS.hole_off_square))
        )
        middle = 0.5 * (piece.opening[0] + piece.opening[1]) + rng.uniform(
            -FURNISHINGS.hole_aside, FURNISHINGS.hole_aside
        )
        position = roots[f + 5] - rotate_planar(np.array((middle, 0.0)), np.float64(heading))
        wall = furniture.cuboids([(piece, position, heading)])
        if (
            wall.signed_distance(np.insert(roots, 2, 1.0, axis=1).astype(np.float32), 1.0).min()
            < FURNISHINGS.hole_room
        ):
            continue
        along = rotate_planar(np.array(((1.0, 0.0),)), np.array((heading,)))[0]
        spots = [position + x * along for x in np.linspace(piece.mins[:, 0].min(), piece.maxs[:, 0].max(), 5)]
        if any(np.linalg.norm(p - spot) < r + 0.3 for p, r in busy for spot in spots):
            continue
        busy += [(spot, 0.4) for spot in spots]
        take.obstacles.append(Placed(piece, position, heading))
        return


def _swept(take: ComposedTake) -> Array:
    """Points (N, 3) float32, world, spread over things that move, where they are in every fourth frame of
    their way.
    """
    points = [np.zeros((0, 3))]
    for thing in take.things:
        if not thing.moves:
            continue
        lo, hi = thing.furniture.mins.min(0), thing.furniture.maxs.max(0)
        grid = (
            np.stack(np.meshgrid(*np.linspace(lo, hi, 4).T, indexing="ij"), axis=-1)
            .reshape(-1, 3)
            .astype(np.float64)
        )
        for x, y, z, heading in np.unique(thing.poses[::4], axis=0):
            points.append(rotate_planar(grid, np.float64(heading)) + (x, y, z))
    return np.concatenate(points).astype(np.float32)


def keep_clear(take: ComposedTake, fixed: int = 0, seat_depth: float = 0.09, depth: float = 0.05) -> bool:
    """Take away obstacles that the body enters deeper than ``depth``, metres, or things moved do; False where
    a seat is walked into.

    The first ``fixed`` obstacles belong to episodes and stay: False where one is entered deeper than
    ``seat_depth``.  Calves brush a seat's edge in the turn before it, hence that allowance.
    """
    kept = take.obstacles[:fixed]
    own = furniture.cuboids([(o.furniture, o.position, o.heading) for o in kept])
    if kept and thin_depths(take.hips[::2], take.rotations[::2], own).max() > seat_depth:
        return False
    swept = _swept(take)
    for o in take.obstacles[fixed:]:
        solid = furniture.cuboids([(o.furniture, o.position, o.heading)])
        if solid.signed_distance(swept, 0.1).min(initial=1.0) < 0:
            continue
        if thin_depths(take.hips[::2], take.rotations[::2], solid).max() < depth:
            kept.append(o)
    take.obstacles = kept
    standing = take.labels[:, SIT] < 0.3
    seats = [
        (t.furniture, t.poses[:3], float(t.poses[3]))
        for t in take.things
        if t.furniture.seat is not None and not t.moves
    ]
    if not seats or not standing.any():
        return True
    return bool(
        thin_depths(take.hips[standing], take.rotations[standing], furniture.cuboids(seats)).max()
        < seat_depth
    )
