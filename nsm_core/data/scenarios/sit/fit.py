"""What a captured sitter owes the seat it is put on: it comes to rest, and back, thighs and hands stay out of
what stands there.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import ANKLES, TOE_OFFSET, TOES
from nsm_core.body.ik.clearance import Clearance, Obstacle
from nsm_core.body.ik.foot_clearance import FOOT_SPHERES
from nsm_core.body.ik.reach import leaning
from nsm_core.body.ik.solver import Pose, Task, solved
from nsm_core.body.ik.tasks import PointTask, TurnTask
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ARMS, FEET, INDEX, forward_kinematics, root_of
from nsm_core.body.tree import HUMAN
from nsm_core.data.scenarios.motion import Motion
from nsm_core.rotations import heading_quat, quat_mul, quat_rotate, wrap_angle
from nsm_core.signals import smooth_step
from nsm_core.world.geometry.distance import DistanceQuery

RESTLESS = 0.12  # share of its sway that a seated body keeps
_EARLY, _LATE = 5, 6  # frames before and after the seat is reached between which the rest is found
# Standard deviations left where a body gives way, metres and radians; frames by which rounds smooth.
_TOE, _FOOT_TURN, _HAND, _HEAD_TURN = 0.001, 0.3, 0.03, 0.1
_ROUNDS = (3.0, 2.0, 1.0, 0.7)
_AROUND = 12  # frames before and after those that need it which are solved too
_LEGS = tuple(leg[:3] for leg in FEET)


def bring_to_rest(motion: Motion, reached: int, still: slice, rise: int) -> None:
    """Let the hips come to the mean place and heading of the frames ``still`` soon after ``reached``, and
    leave it before ``rise``.

    Captured hips go on gliding over the seat for a second; where one sits would then be no place but a
    region.  Changes hips, rotations and headings in place; the feet stay.
    """
    span = slice(max(reached - _EARLY, 0), rise)
    frames = np.arange(span.start, span.stop)
    weight = smooth_step((frames - span.start) / (_EARLY + _LATE)) * smooth_step(
        (rise - frames) / max(rise - still.stop, 1)
    )
    weight *= 1 - RESTLESS
    positions, world = forward_kinematics(motion.hips[span], motion.rotations[span])
    heading = np.unwrap(root_of(positions)[1])
    inside = slice(still.start - span.start, still.stop - span.start)
    off = wrap_angle(heading - heading[inside].mean()) * weight
    ankles = [leg[2] for leg in FEET]
    motion.hips[span] -= weight[:, None] * (motion.hips[span] - motion.hips[still].mean(axis=0))
    turned = motion.rotations[span].copy()
    turned[:, 0] = quat_mul(heading_quat(-off), turned[:, 0])
    motion.headings[span] -= off
    placed = place_limbs(motion.hips[span], turned, _LEGS, positions[:, ankles], world[:, ankles])
    motion.rotations[span] = placed.astype(motion.rotations.dtype)


def keep_off(motion: Motion, span: slice, *solids: DistanceQuery) -> None:
    """Move the body out of ``solids``, smoothly: backs lean, hands give way, and heels rise where
    thighs would press into a seat.  Hips and toes stay.
    """
    hips, local = motion.hips[span].astype(np.float64), motion.rotations[span].astype(np.float64)
    pose = Pose(HUMAN, hips, local)
    limit = Clearance([Obstacle(solid) for solid in solids], left_out=FOOT_SPHERES)
    deep = np.flatnonzero(limit.rows(pose, slice(0, len(hips))).error.any(1))
    if not len(deep):
        return
    part = slice(max(int(deep[0]) - _AROUND, 0), min(int(deep[-1]) + _AROUND, len(hips)))
    span, pose = slice(span.start + part.start, span.start + part.stop), pose.part(part)
    hips, limit = pose.hips, Clearance(limit.solids, left_out=FOOT_SPHERES)
    all_frames = np.ones(len(hips))
    asked: list[Task] = [PointTask(toe, pose.positions[:, toe], _TOE * all_frames) for toe in TOES]
    asked += [TurnTask(ankle, pose.world[:, ankle], _FOOT_TURN * all_frames) for ankle in ANKLES]
    asked += [PointTask(arm[2], pose.positions[:, arm[2]], _HAND * all_frames) for arm in ARMS]
    asked.append(TurnTask(INDEX["Head"], pose.world[:, INDEX["Head"]], _HEAD_TURN * all_frames))
    now = solved(pose, [*asked, limit], leaning(), _ROUNDS)
    feet = now.world[:, ANKLES]
    ankles = pose.positions[:, TOES] - quat_rotate(feet, TOE_OFFSET)
    placed = place_limbs(hips, now.local, _LEGS, ankles, feet)
    motion.rotations[span] = placed.astype(motion.rotations.dtype)


__all__ = ["RESTLESS", "bring_to_rest", "keep_off"]
