"""Which parts of a body may touch a solid: whole bodies are asked for first, then limbs, then spheres."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from nsm_core.rotations import Array

# Distances (N,) of world points (N, 3) in frames (N,), never over a reach, metres.
Distance = Callable[[Array, Array, float], Array]


class Grouped(Protocol):
    """Spheres of a body as ``capsules.Spheres`` has them: numbers of neighbours, and the one at the hips."""

    groups: list[Array]
    middle: int


def near_spheres(
    distance: Distance, centres: Array, radii: Array, spheres: Grouped, margin: float
) -> tuple[Array, Array]:
    """Frames (N,) and spheres (N,) that are less than ``margin`` metres off a solid, coarse to fine.

    ``distance`` tells how far the solid is from world points (N, 3) in frames (N,), never over the reach that
    is asked for; ``centres`` (T, S, 3) world and ``radii`` (T, S), metres.
    """
    middle = centres[:, spheres.middle]
    all_frames = np.arange(len(centres))
    body = float((np.linalg.norm(centres - middle[:, None], axis=2) + radii).max(initial=0.0))
    reach = body + margin + 0.01
    frames = all_frames[distance(all_frames, middle, reach) < body + margin]
    if not len(frames):
        return frames, frames
    found_frames, found = [], []
    for group in spheres.groups:
        own, size = centres[np.ix_(frames, group)], radii[np.ix_(frames, group)]
        centre = own.mean(1)
        around = (np.linalg.norm(own - centre[:, None], axis=2) + size).max(1)
        far = distance(frames, centre, float(around.max()) + margin + 0.01)
        rows = np.flatnonzero(far < around + margin)
        if not len(rows):
            continue
        t = np.repeat(frames[rows], len(group))
        s = np.tile(group, len(rows))
        away = distance(t, centres[t, s], float(size.max()) + margin + 0.01)
        near = away < radii[t, s] + margin
        found_frames.append(t[near])
        found.append(s[near])
    if not found:
        return frames[:0], frames[:0]
    return np.concatenate(found_frames), np.concatenate(found)
