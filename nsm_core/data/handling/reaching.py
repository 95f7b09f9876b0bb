"""A captured reach led to another place: the wrist's way is warped, the whole body follows by the solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import ANKLES
from nsm_core.body.ik.footsteps import FOOT, FOOT_TURN
from nsm_core.body.ik.reach import FURTHEST, shifting
from nsm_core.body.ik.solver import Pose, Task, solved
from nsm_core.body.ik.tasks import PointTask, TurnTask
from nsm_core.body.skeleton import ARMS
from nsm_core.body.tree import HUMAN
from nsm_core.rotations import Array, rotate_planar
from nsm_core.signals import gaussian_smooth

MARGIN = 12  # frames about a reach in which what it changed fades
WRIST, LOOSE = 0.002, 0.05  # metres that may be left of the wrist's way: at its end, and where it begins
_SMOOTH = (4.0, 3.0, 2.0, 1.5, 1.0)


@dataclass(frozen=True)
class ReachMove:
    """One reach of a performance: the hand ``side`` (0 right, 1 left) sets out at frame ``start``, is at its
    goal from ``there`` to ``leaves`` and back at ``end``; ``goal`` (3,) is where, seen from the root of frame
    ``there``.
    """

    side: int
    start: int
    there: int
    leaves: int
    end: int
    goal: Array


def share_gone(way: Array) -> Array:
    """Share (T,) 0..1 of its way (T, 3) that a wrist has gone, by its length."""
    steps = np.linalg.norm(np.diff(way, axis=0), axis=-1)
    gone = np.concatenate(((0.0,), np.cumsum(steps)))
    return gone / max(float(gone[-1]), 1e-6)


def fit_reach(
    hips: Array, local: Array, roots: Array, headings: Array, reach: ReachMove
) -> tuple[Array, Array]:
    """Lead a reach of a motion, hips (T, 3) and local rotations (T, J, 4) on roots (T, 2) and headings (T,),
    to its goal; the feet stay as they are.  Returns the motion's hips and rotations, changed about the reach.
    """
    first, last = max(reach.start - MARGIN, 0), min(reach.end + MARGIN, len(hips))
    span = slice(first, last)
    pose = Pose(HUMAN, hips[span].astype(np.float64), local[span].astype(np.float64))
    wrist = ARMS[reach.side][2]
    way = pose.positions[:, wrist]
    there, leaves = reach.there - first, reach.leaves - first
    goal = rotate_planar(reach.goal, np.float64(headings[reach.there]))
    goal = goal + np.append(roots[reach.there], 0.0)
    weight = np.ones(len(way))
    begin, over = reach.start - first, min(reach.end - first, len(way) - 1)
    weight[: begin + 1] = 0.0
    weight[begin : there + 1] = share_gone(way[begin : there + 1])
    weight[leaves : over + 1] = share_gone(way[leaves : over + 1][::-1])[::-1]
    weight[over:] = 0.0
    weight = gaussian_smooth(weight, 3.0)[:, None]
    weight[there : leaves + 1] = 1.0
    held = way.copy()
    held[there : leaves + 1] = goal
    target = np.where(weight == 1.0, held, way + weight * (goal - way[there]))
    deviation = WRIST + (LOOSE - WRIST) * (1 - weight[:, 0])
    deviation[(np.arange(len(way)) <= begin) | (np.arange(len(way)) >= over)] = np.inf
    tasks: list[Task] = [PointTask(wrist, target, deviation)]
    for ankle in ANKLES:
        tasks.append(PointTask(ankle, pose.positions[:, ankle].copy(), np.full(len(way), FOOT)))
        tasks.append(TurnTask(ankle, pose.world[:, ankle].copy(), np.full(len(way), FOOT_TURN)))
    done = solved(pose, tasks, shifting(), _SMOOTH, FURTHEST)
    hips, local = hips.copy(), local.copy()
    hips[span], local[span] = done.hips, done.local
    return hips, local


__all__ = ["ReachMove", "fit_reach", "share_gone"]
