"""Goals that are to be reached at a given time: by waiting before them, by the pace of the way, and, for the
rest, by a motion that is played a little faster or slower.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nsm_core.body.clip import resample
from nsm_core.conventions import FPS
from nsm_core.rotations import Array

from .goals import Goal, GoalResult

if TYPE_CHECKING:
    from .take import TakeResult

WARP = 0.1  # share by which a motion may be played faster or slower
PACES = (0.85, 1.3)  # of the usual speed, from the slowest to the fastest
_NEAR = 0.5 / FPS  # seconds that are as good as none
_REACHES = 0.9  # share of a goal's time that is a way, about


def rounds(goals: Sequence[Goal]) -> int:
    """How often a take may be performed anew for the times of its goals."""
    return 3 * sum(goal.by is not None for goal in goals)


def retimed(goals: Sequence[Goal], results: Sequence[GoalResult]) -> list[Goal] | None:
    """The goals with waits and paces by which the first one that was reached at a wrong time, by more than
    can be played faster or slower, is reached nearer to it; None where nothing is left to be done.
    """
    for k, (goal, result) in enumerate(zip(goals, results, strict=True)):
        if goal.by is None or not result.reached:
            continue
        spare = goal.by - result.end_frame / FPS
        if abs(spare) <= WARP * result.seconds:
            continue
        wait, pace = goal.wait, goal.pace
        slower = pace * result.seconds / max(result.seconds + spare / _REACHES, 1e-3)
        if spare < 0 and wait > 0:
            wait = max(0.0, wait + spare)
        elif spare < 0:
            pace = min(PACES[1], slower) if slower > 0 else PACES[1]
        elif slower >= PACES[0] and wait == 0:
            pace = slower
        else:
            wait += spare
        if abs(wait - goal.wait) < _NEAR and abs(pace - goal.pace) < 0.01:
            continue  # it cannot be faster
        return [*goals[:k], replace(goal, wait=wait, pace=pace), *goals[k + 1 :]]
    return None


def played_in_time(take: TakeResult, goals: Sequence[Goal]) -> TakeResult:
    """The take with every goal reached when it should be, as far as ``WARP`` allows; ``late`` of the results
    tells what is missing, seconds.  It stays as it is where no goal has a time.
    """
    if all(goal.by is None for goal in goals):
        return take
    old, new, results = [0.0], [0.0], []
    for goal, result in zip(goals, take.goals, strict=True):
        if goal.by is None or not result.reached:
            continue
        begin, end, shift = float(result.start_frame), float(result.end_frame), new[-1] - old[-1]
        most = WARP * (end - begin)
        wanted = float(np.clip(goal.by * FPS, end + shift - most, end + shift + most))
        if begin > old[-1]:
            old.append(begin)
            new.append(begin + shift)
        if end > old[-1]:
            old.append(end)
            new.append(max(wanted, new[-1] + 1.0))
    last = len(take.root) - 1
    if last > old[-1]:
        old.append(float(last))
        new.append(last + new[-1] - old[-2])
    count = round(new[-1])
    at = np.interp(np.arange(count + 1), new, old)

    def frame(number: int) -> int:
        return number if number < 0 else round(float(np.interp(number, old, new)))

    for goal, result in zip(goals, take.goals, strict=True):
        begin, end = frame(result.start_frame), frame(result.end_frame)
        taken = None if result.taken is None else replace(result.taken, frame=frame(result.taken.frame))
        late = end / FPS - goal.by if goal.by is not None and result.reached else 0.0
        late = 0.0 if abs(late) <= _NEAR else late
        seconds = (end - begin) / FPS
        results.append(
            replace(result, start_frame=begin, end_frame=end, seconds=seconds, taken=taken, late=late)
        )
    nearest = at.round().astype(int)
    hips, rotations = resample(take.hips_position, take.local_rotations, at / FPS, FPS)
    network_hips, network_rotations = resample(take.network_hips, take.network_rotations, at / FPS, FPS)
    return replace(
        take,
        hips_position=hips,
        local_rotations=rotations,
        network_hips=network_hips,
        network_rotations=network_rotations,
        contacts=take.contacts[nearest],
        root=_between(take.root, at),
        action=_between(take.action, at),
        experts=_between(take.experts, at),
        goals=results,
        props={name: _between(poses, at, turning=3) for name, poses in take.props.items()},
        insights={t: take.insights[k] for t, k in enumerate(nearest.tolist()) if k in take.insights},
    )


def _between(values: Array, at: Array, turning: int = 2) -> Array:
    """Values (T, n) at times ``at`` (N,) in frames; column ``turning`` of roots and poses is an angle."""
    if values.shape[1:] in ((3,), (4,)):
        values = values.copy()
        values[:, turning] = np.unwrap(values[:, turning])
    frames = np.arange(len(values))
    columns = [np.interp(at, frames, column) for column in values.T]
    return np.stack(columns, axis=1).astype(values.dtype) if columns else values[at.round().astype(int)]


__all__ = ["PACES", "WARP", "played_in_time", "retimed", "rounds"]
