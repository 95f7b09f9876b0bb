"""Times of arrival over a grid: the Eikonal equation |grad T| = slowness, by updates of the front alone.

The solution is the one of the fast marching method (Sethian 1996): first-order upwind differences after
Godunov.  Cells are not taken one by one in order of time, as there, but all at once that a neighbour has just
changed (Jeong and Whitaker's fast iterative method), which suits arrays.
"""

from __future__ import annotations

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array

NEVER = 1e9  # the time of what is not reached
_EARLIER = 1e-6  # of itself, by which a time must become earlier to matter


def arrival_times(slowness: Array, start: Array, cell: float) -> Array:
    """Times (X, Y, Z) at which a front that leaves from a ``start`` arrives; ``NEVER`` where it does not.

    ``slowness`` (X, Y, Z) seconds a metre, infinite in what the front cannot enter; ``start`` (X, Y, Z)
    seconds where the front is known, infinite elsewhere; these stay as they are.  ``cell`` metres.  Raises
    GeometryError where shapes differ, nothing starts or slowness is not positive.
    """
    slow, begun = np.asarray(slowness, dtype=np.float64), np.asarray(start, dtype=np.float64)
    known = np.isfinite(begun)
    if slow.shape != begun.shape or slow.ndim != 3 or not known.any() or not (slow > 0).all() or cell <= 0:
        raise GeometryError("A front needs a grid of positive slowness and a cell to start from.")
    padded = np.array(slow.shape) + 2
    inner = (slice(1, -1),) * 3
    time, step = np.full(padded, NEVER), np.zeros(padded)
    time[inner] = np.where(known, begun, NEVER)
    open_ = np.zeros(padded, bool)
    open_[inner] = np.isfinite(slow) & ~known
    step[inner] = np.where(np.isfinite(slow), slow, 0.0) * cell
    strides = (int(padded[1] * padded[2]), int(padded[2]), 1)
    t, s, free = time.reshape(-1), step.reshape(-1), open_.reshape(-1)
    around = np.array([d * n for n in strides for d in (-1, 1)])
    marked = np.zeros(len(t), bool)
    changed = np.flatnonzero(t < NEVER)
    while len(changed):
        marked[:] = False
        marked[(changed[:, None] + around).reshape(-1)] = True
        marked &= free
        front = np.flatnonzero(marked)
        a, b, c = (np.minimum(t[front - n], t[front + n]) for n in strides)
        new = _godunov(a, b, c, s[front])
        earlier = new < t[front] * (1 - _EARLIER)
        changed = front[earlier]
        t[changed] = new[earlier]
    return time[inner]


def _godunov(a: Array, b: Array, c: Array, f: Array) -> Array:
    """The upwind time (N,) of cells from the earlier neighbour along each axis and the step's own time."""
    low = np.minimum(np.minimum(a, b), c)
    high = np.maximum(np.maximum(a, b), c)
    # By subtraction of large numbers the middle one would lose its digits.
    middle = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))
    gap = middle - low
    two = (low + middle + np.sqrt(np.maximum(2 * f * f - gap * gap, 0))) / 2
    time = np.where(gap < f, two, low + f)
    # Relative to the earliest: the sum of squares keeps its digits.
    far = np.minimum(high - low, 4 * f)
    sums = np.minimum(gap, 4 * f) + far
    squares = np.minimum(gap, 4 * f) ** 2 + far**2
    three = low + (sums + np.sqrt(np.maximum(sums * sums - 3 * (squares - f * f), 0))) / 3
    return np.where(time > high, three, time)
