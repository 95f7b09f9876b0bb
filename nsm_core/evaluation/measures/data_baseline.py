"""What the training data itself does, to compare roll-outs with: foot slide by action."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nsm_core.conventions import CLIMB, FPS
from nsm_core.data.storage import Dataset
from nsm_core.model.features.layout import CELLS
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.sensors.interaction import RESOLUTION

from .objects import slide_by_action, slide_table

MOST = 240.0  # minutes of data that are looked at


def slide_of_data(folder: str | Path, most: float = MOST) -> dict[str, float]:
    """Foot slide in cm/s by action of the first ``most`` minutes of composed data, feet over what they stand
    on.
    """
    a = Dataset.open(folder).arrays
    first = np.unique(np.asarray(a["start"]))
    sums, frames = [], 0
    for start in first:
        end = int(a["end"][start])
        span = slice(int(start), end)
        style = np.asarray(a["style"][span])
        sums.append(slide_by_action(np.asarray(a["joint_position"][span]), style, _ground(a, span, style)))
        frames += end - int(start)
        if frames > most * 60 * FPS:
            break
    return slide_table(sums)


def _ground(a: dict[str, Array], span: slice, style: Array) -> Callable[[Array], Array] | None:
    """Heights of what a take climbs on, from its objects' sensor readings; None where it climbs nothing."""
    which = np.asarray(a["object"][span])
    climbed = np.unique(which[(style[:, CLIMB] > 0.5) & (which >= 0)])
    if not len(climbed):
        return None
    maps = []
    for k in climbed:
        frame = span.start + int(np.flatnonzero(which == k)[0])
        maps.append(
            (
                np.asarray(a["object_pose"][frame], dtype=np.float64),
                *_tops(a["object_cells"][k], a["object_occupancy"][k]),
            )
        )

    def height(points: Array) -> Array:
        out = np.zeros(len(points))
        for pose, low, size, tops in maps:
            local = rotate_planar(np.asarray(points, dtype=np.float64) - pose[:2], -pose[3])
            cell = np.floor((local - low) / size).astype(int)
            inside = ((cell >= 0) & (cell < RESOLUTION)).all(1)
            i, j = np.clip(cell, 0, RESOLUTION - 1).T
            np.maximum(out, np.where(inside, tops[i, j] + pose[2] * (tops[i, j] > 0), 0), out=out)
        return out

    return height


def _tops(cells: Array, occupancy: Array) -> tuple[Array, Array, Array]:
    """Least corner (2,), cell size (2,) and heights (8, 8) by x and y of the columns of a sensor volume in
    its object's frame.
    """
    grid = np.asarray(cells, dtype=np.float64).reshape(RESOLUTION, RESOLUTION, RESOLUTION, 3)  # z, y, x
    assert grid.size == CELLS * 3
    step = (grid[-1, -1, -1] - grid[0, 0, 0]) / (RESOLUTION - 1)
    solid = np.asarray(occupancy).reshape(RESOLUTION, RESOLUTION, RESOLUTION) > 0.999
    heights = np.where(solid, (grid[..., 2] + step[2] / 2), 0).max(0).T
    return grid[0, 0, 0, :2] - step[:2] / 2, step[:2], heights
