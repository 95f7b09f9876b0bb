"""Goals along lines: kept to, at the speed that is asked for, around what stands in them."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.clip import smoothed_root
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.actions.follow import heading_at_end
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult, roll
from nsm_core.errors import GoalError
from nsm_core.model.inference.model import load_model
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import resample_path
from nsm_core.world.planning.track import off_line

T = np.linspace(0, 2 * np.pi, 120)
S = np.stack((0.6 * T, 0.7 * np.sin(T) - 1.0), -1)


def along(line: np.ndarray, action: str = "walk", **more) -> Goal:
    return Goal(action, "Path", np.append(line[-1], 0), heading_at_end(line), 0.1, way=line, **more)


def gone(goal: Goal, solids: Cuboids | None = None) -> TakeResult:
    return roll(
        load_model(backend="numpy"),
        TakeRequest(np.zeros(2), 0.0, [goal], Cuboids() if solids is None else solids, contact_ik=False),
    )


def test_a_walk_keeps_to_its_line_at_its_speed():
    take = gone(along(S, speed=0.9))
    (result,) = take.goals
    assert result.reached and not result.remarks
    mean, most = result.line_cm
    assert mean < 3.0 and most < 10.0
    assert result.position_error_cm < 10 and result.rotation_error_deg < 15
    speed = np.linalg.norm(np.diff(take.root[:, :2], axis=0), axis=1) * 30
    assert np.median(speed[60:-60]) == pytest.approx(0.85, abs=0.12), "a little slower in bends"


def test_a_corner_that_is_too_tight_is_told_and_the_start_is_not_cut():
    line = np.array(((1.0, -1.0), (-1.0, -1.0), (-1.0, -2.5)))
    (result,) = (take := gone(along(line, speed=1.2))).goals
    assert result.remarks == [
        "It slowed down to 0.5 m/s at (-1.00, -1.00) m, where the line bends too tightly for its pace"
    ]
    joints = forward_kinematics(take.hips_position, take.local_rotations)[0]
    away = off_line(resample_path(line, 0.02), smoothed_root(joints)[0])
    assert away[:35].max() < 0.05, "it came to the line along it"


def test_it_goes_around_what_stands_in_it_and_says_so():
    take = gone(along(S), Cuboids([((1.9, -1.0), 0.0, [(-0.2, -0.3, 0)], [(0.2, 0.3, 1)])]))
    (result,) = take.goals
    assert result.reached and len(result.remarks) == 1 and "went around" in result.remarks[0]
    assert result.line_cm[0] < 5.0


@pytest.mark.parametrize(("action", "speed"), [("walk", 2.2), ("run", 1.0), ("walk", 0.0), ("idle", 1.0)])
def test_speeds_that_nobody_has_learned(action, speed):
    with pytest.raises(GoalError, match="m/s|no speed"):
        Goal(action, "Path", np.zeros(3), 0.0, speed=speed)


def test_where_lines_end_they_are_faced():
    assert heading_at_end(np.array(((0, 0), (0, -1.0)))) == pytest.approx(0.0)
    assert heading_at_end(np.array(((0, 0), (1, 0), (1.0, 0)))) == pytest.approx(np.pi / 2)
