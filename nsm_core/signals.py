"""Signals over time: smoothing, easing and the spans in which something holds."""

from __future__ import annotations

from typing import Any

import numpy as np

from .components import clamp
from .rotations import Array, Scalars


def intervals(on: Array) -> list[tuple[int, int]]:
    """Half-open intervals in which (T,) flags are set."""
    edges = np.flatnonzero(
        np.diff(np.concatenate(((False,), np.asarray(on, bool), (False,))).astype(np.int8))
    )
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def smooth_step(t: Scalars) -> Any:
    """Ease of shares, 0 below 0 and 1 above 1: a float of a float, else an array."""
    t = clamp(t, 0.0, 1.0) if isinstance(t, float) else np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def gaussian_smooth(values: Array, sigma_frames: float) -> Array:
    """Smooth (T, ...) along time with a Gaussian; ends are point-mirrored so that velocity is kept."""
    radius = int(np.ceil(3 * sigma_frames))
    if len(values) < 2 or radius == 0:
        return values.copy()
    n = min(radius, len(values) - 1)
    head, tail = 2 * values[:1] - values[n:0:-1], 2 * values[-1:] - values[-2 : -n - 2 : -1]
    pad = radius - n
    padded = np.concatenate((np.repeat(head[:1], pad, 0), head, values, tail, np.repeat(tail[-1:], pad, 0)))
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma_frames) ** 2)
    kernel /= kernel.sum()
    flat = padded.reshape(len(padded), -1)
    smooth = np.stack([np.convolve(flat[:, c], kernel, mode="valid") for c in range(flat.shape[1])], axis=1)
    return smooth.reshape(values.shape).astype(values.dtype)


def align_quaternions(q: Array) -> Array:
    """Flip signs along time so that (T, ..., 4) quaternions never jump to the other half."""
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0, -1.0, 1.0), axis=0)
    return np.concatenate((q[:1], q[1:] * flips[..., None]))


def ease(t: Scalars) -> Array:
    """Minimum-jerk step of (...) from 0 to 1."""
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t * t)


def cheapest_sequence(cost: Array, change: Array) -> Array:
    """Choices (N,) of the sequence over costs (N, F) that costs the least with its changes: ``change`` (F, F)
    from one choice to the next, infinite where that may not be (dynamic programming).
    """
    total, came = cost[0], np.zeros(cost.shape, int)
    for n in range(1, len(cost)):
        ways = total[:, None] + change
        came[n] = ways.argmin(0)
        total = ways[came[n], np.arange(len(change))] + cost[n]
    chosen = [int(total.argmin())]
    for n in range(len(cost) - 1, 0, -1):
        chosen.append(int(came[n, chosen[-1]]))
    return np.array(chosen[::-1])
