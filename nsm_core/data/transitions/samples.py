"""Heights of the ground around a way, sampled once: a gap asks for 169 of them every frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.model.transitions.layout import PATCH_SIZE
from nsm_core.rotations import Array

# Metres between samples, half of what is between the points of a patch; and beside the captured way that a
# network's own may lie.
FINE, ASTRAY = PATCH_SIZE / 24, 0.3


@dataclass(frozen=True)
class Samples:
    """``heights`` (rows, columns) from ``low`` (2,) on, FINE metres apart, the rows along x."""

    low: Array
    heights: Array

    @classmethod
    def around(cls, way: Array, heights: Callable[[Array], Array]) -> Samples:
        """Of the ground that ``heights`` (N,) at places (N, 2) tells, around a way (T, 2)."""
        # What is seen is turned: its corners are further off than its sides.
        margin = PATCH_SIZE / np.sqrt(2) + ASTRAY
        low = way.min(0) - margin
        counts = np.ceil((way.max(0) + margin - low) / FINE).astype(int) + 1
        lines = np.meshgrid(*[FINE * np.arange(n, dtype=np.float32) for n in counts], indexing="ij")
        places = low + np.stack(lines, -1).reshape(-1, 2)
        return cls(low.astype(np.float32), heights(places).astype(np.float32).reshape(counts))


def sampled(grounds: Sequence[Samples]) -> Callable[[Array], Array]:
    """Heights (B, N) at places (B, N, 2) of B grounds, between samples bilinear; what is off a ground's is as
    high as their edge.
    """
    low = np.stack([g.low for g in grounds])[:, None]
    shapes = np.array([g.heights.shape for g in grounds])
    flat = np.concatenate([g.heights.ravel() for g in grounds])
    base = np.concatenate(([0], np.cumsum(shapes.prod(1))))[:-1, None]
    columns, most = shapes[:, 1:], (shapes - 1.001).astype(np.float32)[:, None]

    def heights(places: Array) -> Array:
        at = np.clip((places - low) * np.float32(1 / FINE), 0, most)
        cell = at.astype(np.int64)
        part = at - cell
        first = base + cell[..., 0] * columns + cell[..., 1]
        u, v = part[..., 0], part[..., 1]
        near = flat[first] * (1 - v) + flat[first + 1] * v
        far = flat[first + columns] * (1 - v) + flat[first + columns + 1] * v
        return np.asarray(near * (1 - u) + far * u)

    return heights


__all__ = ["Samples", "sampled"]
