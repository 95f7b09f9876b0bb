"""Which places of a floor can be walked to from another one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.rotations import Array

from .floor_plan import BRUSH, FloorPlan

CELL, AROUND = 0.1, 3.0  # metres of a cell, and around all that is asked about that ways may lead over
BESIDE = 0.35  # metres of a narrow way from free floor to where a body still comes to stand


def walked_to(plan: FloorPlan, start: Array, about: Array) -> Callable[[Array], Array]:
    """Whether (N,) a body comes from ``start`` (2,) to places (N, 2), over the floor around them all:
    ``about`` (K, 2) are among them.
    """
    ends = np.concatenate((np.asarray(start, float)[None, :2], np.asarray(about, float)[:, :2]))
    low = np.maximum(ends.min(0) - AROUND, plan.bounds[0])
    high = np.minimum(ends.max(0) + AROUND, plan.bounds[1])
    lines = [np.arange(a, b, CELL) for a, b in zip(low, high, strict=True)]
    cells = np.stack(np.meshgrid(*lines, indexing="ij"), -1)
    room = plan.clearance(cells.reshape(-1, 2)).reshape(cells.shape[:2])
    known = _grown(room >= plan.radius, cells, ends[0])
    for _ in range(round(BESIDE / CELL)):  # squeezing past things, through none
        known |= _beside(known) & (room > BRUSH)

    def reached(places: Array) -> Array:
        index = np.round((np.asarray(places, float)[:, :2] - low) / CELL).astype(int)
        within = ((index >= 0) & (index < known.shape)).all(1)
        return within & known[tuple(np.clip(index, 0, np.array(known.shape) - 1).T)]

    return reached


def _beside(grown: Array) -> Array:
    """Those cells and their neighbours along either axis."""
    wide = np.pad(grown, 1)
    return np.asarray(wide[1:-1, 1:-1] | wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2])


def room_walked_to(plan: FloorPlan, start: Array, about: Array) -> Callable[[Array], Array]:
    """The clearance (N,), metres, of places (N, 2) that a body comes to from ``start`` (2,), as ``walked_to``
    tells; less than any where it does not.
    """
    reached = walked_to(plan, start, about)
    return lambda places: np.where(reached(places), plan.clearance(places), -np.inf)


def _grown(free: Array, cells: Array, start: Array) -> Array:
    """The free cells that hang together with the one nearest to ``start``."""
    grown = np.zeros_like(free)
    if not free.any():
        return grown
    away = np.where(free, np.linalg.norm(cells - start, axis=-1), np.inf)
    grown[np.unravel_index(away.argmin(), free.shape)] = True
    count = 0
    while grown.sum() > count:
        count = int(grown.sum())
        grown = free & _beside(grown)
    return grown


__all__ = ["room_walked_to", "walked_to"]
