"""How far a take ended from its goals: of the network alone when a goal is reached, and of what is kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nsm_core.body.capsules import Figure
from nsm_core.body.clip import smoothed_root
from nsm_core.body.skeleton import ARMS, forward_kinematics, root_of
from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.planning.floor_plan import resample_path
from nsm_core.world.planning.track import off_line

from .director import Director, rotation_error
from .goals import GoalResult

_WRISTS = [arm[2] for arm in ARMS]


def judge_reached(director: Director, network_hips: Array, heading: float) -> bool:
    """Write the errors of a goal whose transition has just ended, of hips (3,), world metres, and heading as
    the network has them; whether the motion that is kept is to be judged in this frame, too.
    """
    result = director.results[director.index]
    if director.index < 0 or result.seconds <= 0 or np.isfinite(result.position_error_cm):
        return False
    stage, prop = director.stage, director.goals[director.index].prop
    assert stage is not None
    result.place, result.facing, result.axes = stage.target()
    result.line, result.remarks = stage.line()
    # It was not set down where it should be.
    if prop is not None and BY_KEY[result.action].needs_destination:
        result.axes = 3
        result.position_error_cm, result.rotation_error_deg = goal_errors(
            result, prop.pose[:3], float(prop.pose[3])
        )
        return False
    own = goal_errors(result, network_hips, heading)
    result.network_position_error_cm, result.network_rotation_error_deg = own
    result.position_error_cm, result.rotation_error_deg = own  # until the take is solved
    return True


def judge_kept(
    director: Director,
    reached: Mapping[int, int],
    hips: Array,
    rotations: Array,
    poses: Mapping[str, Sequence[Array]],
    figure: Figure,
) -> None:
    """Write the errors of the motion that is kept, hips (T, 3), rotations (T, 23, 4): of hips at the goals,
    each in its frame of ``reached``, and of hands where they have taken hold of props with ``poses``.
    """

    def joints(frames: slice) -> Array:
        return forward_kinematics(hips[frames], rotations[frames], figure.offsets)[0]

    for index, frame in reached.items():
        heading = float(root_of(joints(slice(frame, frame + 1))[0])[1])
        result = director.results[index]
        result.position_error_cm, result.rotation_error_deg = goal_errors(result, hips[frame], heading)
    for result, goal in zip(director.results, director.goals, strict=True):
        if result.line is not None:
            result.line_cm = line_errors(result.line, joints(slice(result.start_frame, result.end_frame + 1)))
        taken = result.taken
        if taken is not None and 0 <= taken.frame < len(hips):
            wrists = joints(slice(taken.frame, taken.frame + 1))[0, _WRISTS]
            pose = np.zeros(4) if goal.prop is None else poses[goal.prop.name][taken.frame]
            result.hand_error_cm, result.hand_rotation_deg = taken.errors(wrists, pose)


def line_errors(line: Array, joints: Array) -> tuple[float, float]:
    """Mean and largest centimetres from a line (N, 2) to the ground track of joints (T, 23, 3), from where it
    comes to the line's start.
    """
    away = 100 * off_line(resample_path(line, 0.02), smoothed_root(joints)[0])
    return float(away.mean()), float(away.max())


def goal_errors(result: GoalResult, position: Array, heading: float) -> tuple[float, float]:
    """Centimetres and degrees between a place (3,) and heading and what a goal's errors are measured to; 0
    where there is none.
    """
    if result.place is None:
        return 0.0, 0.0
    away = np.asarray(position)[: result.axes] - np.asarray(result.place)[: result.axes]
    return 100 * float(np.linalg.norm(away)), rotation_error(heading, result.facing)
