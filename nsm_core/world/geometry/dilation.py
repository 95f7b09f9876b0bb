"""Masks of grids grown over their neighbourhoods."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array


def grown(mask: Array, n: int) -> Array:
    """Cells of a grid (bool, of any shape) that have a set one within ``n`` cells along every axis; beyond
    the grid's edge nothing is set.
    """
    for axis in range(mask.ndim):
        line = np.moveaxis(mask, axis, 0)
        spread = line.copy()
        for step in range(1, n + 1):
            spread[step:] |= line[:-step]
            spread[:-step] |= line[step:]
        mask = np.moveaxis(spread, 0, axis)
    return mask


__all__ = ["grown"]
