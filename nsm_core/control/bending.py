"""A body that bends over and goes down for what one hand takes: before the take is solved, as far as that
hand's shoulder is too far off.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from nsm_core.body.capsules import Figure
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.ik.footsteps import Footsteps
from nsm_core.body.ik.reach import FURTHEST, SMOOTH, bending
from nsm_core.body.ik.solver import Pose, solve
from nsm_core.body.ik.tasks import ReachTask
from nsm_core.body.skeleton import ARMS
from nsm_core.rotations import Array

from .actions.hold import Lead
from .crouching import Crouched, crouched

STRETCHED = 0.94  # share of its arm's length at which a hand still works with ease


def bent(
    pose: Pose,
    leads: Sequence[Sequence[Lead]],
    figure: Figure,
    headings: Array,
    feet: Footsteps,
    solids: Sequence[Obstacle],
) -> Generator[None, None, Pose]:
    """The motion with shoulders within reach of where ``leads`` want hands that a body bends for, over
    ``feet`` that stand, among ``solids``; ``headings`` (T,) of the body; yields now and then.  Feet are put
    back by who plants them.
    """
    count = len(leads)
    shoulders = [arm[0] for arm in ARMS]
    targets, reach = pose.positions[:, shoulders].copy(), np.full((count, 2), np.inf)
    arms = [float(np.linalg.norm(figure.offsets[list(arm[1:])], axis=1).sum()) for arm in ARMS]
    for t, each in enumerate(leads):
        for lead in each:
            if lead.bends:
                # A hand that is drawn in half is reached for in half.
                targets[t, lead.hand] = lead.target
                reach[t, lead.hand] = STRETCHED * arms[lead.hand] / max(lead.share, 0.1)
    if not np.isfinite(reach).any():
        return pose
    pose = crouched(pose, Crouched(headings, feet, targets, reach), solids, figure)
    yield
    task = ReachTask(shoulders, targets, np.where(np.isfinite(reach), reach, 1e3))
    return (yield from solve(pose, [task], bending(), SMOOTH, FURTHEST))


__all__ = ["bent"]
