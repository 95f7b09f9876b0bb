"""Ways of hands judged on layouts that were not learnt from (papers/002 table 3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.data.reaches.ways import HandTask
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_way import STRAIGHT

CLEAR = 0.03  # metres of a wrist's middle to anything under which it has touched that
AROUND = 0.2  # metres around the end of a way within which its room counts
_STANDS, _TOUCHED = 0.04, -0.01  # metres from its place within which a thing may touch; how deep it may
_FAR = 0.4  # metres up to which room is told
_ENDS = 0.01  # metres off the grasp at which a hand has arrived
_POINTS = 60  # of a thing's surface that are looked at

# A way of a wrist (T, 3) at 30 Hz, world, to a task; None where it found none.
Planner = Callable[[HandTask], Array | None]


@dataclass(frozen=True)
class Judged:
    """Of ways: share that touch nothing and arrive; of those, metres of room around their end and
    acceleration of the wrist, m/s2, means over frames; seconds of one core for each.
    """

    success: float
    room: float
    acceleration: float
    seconds: float


def judge(planner: Planner, tasks: Sequence[HandTask]) -> Judged:
    """Plan the ways of all tasks and look how they go."""
    success, room, acceleration, seconds = [], [], [], []
    for task in tasks:
        begun = process_time()
        path = planner(task)
        seconds.append(process_time() - begun)
        free = None if path is None else room_along(task, path)
        good = path is not None and free is not None and arrives(task, path) and clear(task, path)
        success.append(good)
        if path is not None and free is not None and good:
            near = np.linalg.norm(path - path[-1], axis=1) < AROUND
            room.append(float(free[near].mean()))
            acceleration.append(float(np.linalg.norm(np.diff(path, 2, axis=0), axis=1).mean() * FPS**2))
    means = (float(np.mean(values or [np.nan])) for values in (success, room, acceleration, seconds))
    return Judged(*means)


def arrives(task: HandTask, path: Array) -> bool:
    """Whether a way ends at its grasp."""
    return bool(np.linalg.norm(path[-1] - task.wrist.place) < _ENDS)


def clear(task: HandTask, path: Array) -> bool:
    """Whether a way (T, 3) touches nothing: the wrist, what is in the hand but where it stands, and an empty
    one the thing itself but where it is taken.
    """
    free = task.around.signed_distance(path.astype(np.float32), _FAR)
    if task.laden:
        held = _held(task, path)
        off = np.linalg.norm(path - task.wrist.place, axis=1) > _STANDS
        touched = off.any() and float(held[off].min()) < _TOUCHED
    else:
        off = np.linalg.norm(path - task.wrist.place, axis=1) > STRAIGHT
        to_thing = task.thing.signed_distance(path[off].astype(np.float32), _FAR)
        touched = off.any() and float(to_thing.min()) < CLEAR
    return bool(free.min() > CLEAR and not touched)


def room_along(task: HandTask, path: Array) -> Array:
    """Metres (T,) from the wrist, and from what is in the hand, to the nearest of everything else."""
    free = task.around.signed_distance(path.astype(np.float32), _FAR)
    return np.minimum(free, _held(task, path)) if task.laden else free


def _held(task: HandTask, path: Array) -> Array:
    """Metres (T,) from the thing, which goes with a wrist along a path, to everything else."""
    vertices = task.thing.mesh()[0]
    some = vertices[np.unique(np.linspace(0, len(vertices) - 1, _POINTS).astype(int))]
    at = task.thing.to_world(some)[None] + (path - task.wrist.place)[:, None]
    free = task.around.signed_distance(at.reshape(-1, 3).astype(np.float32), _FAR)
    return np.asarray(free.reshape(len(path), -1).min(1))


__all__ = ["Judged", "Planner", "clear", "judge"]
