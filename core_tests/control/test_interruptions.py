"""A take may be told at any frame to do something else: it goes on from where it is, without a pop, and loses
nothing.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.director import TURNING
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.motion import jumps
from nsm_core.model.features.state import PIVOT
from nsm_core.model.inference.model import Model, load_model
from nsm_core.world.geometry.distance import Cuboids


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def walk_to(x: float, y: float) -> Goal:
    return Goal("walk", f"{x:g} {y:g}", np.array((x, y, 0.0)), 0.0, 0.1)


def test_another_goal_in_the_middle_of_a_walk(model):
    runner = TakeRunner(
        model, TakeRequest(np.zeros(2), 0.0, [walk_to(0, -4), walk_to(3, -4)], Cuboids(), time_limit=12.0)
    )
    while runner.frames < 75:
        assert runner.step()
    before = runner.state.root[0].copy()
    runner.interrupt([walk_to(2.0, 0.3)])
    while runner.step():
        pass
    result = runner.result()
    assert [g.object for g in result.goals] == ["0 -4", "2 0.3"]
    given_up, done = result.goals
    assert not given_up.reached and given_up.end_frame == 75 - 1 and given_up.seconds > 1
    assert done.reached and np.linalg.norm(result.root[-1, :2] - (2.0, 0.3)) < 0.3
    assert np.linalg.norm(result.root[76, :2] - before[:2]) < 0.1
    around = slice(60, 110)
    assert jumps(result.hips_position[around], result.local_rotations[around])["turn_per_frame_deg"] < 30


def test_goals_off_the_planned_floor_and_after_the_end(model):
    runner = TakeRunner(
        model,
        TakeRequest(
            np.zeros(2), 0.0, [Goal("idle", "here", np.zeros(3), 0.0, 0.1)], Cuboids(), time_limit=12.0
        ),
    )
    while runner.step():
        pass
    frames = runner.frames
    runner.interrupt([walk_to(0.0, -7.0)])
    while runner.step():
        pass
    assert runner.frames > frames + 100 and runner.result().goals[-1].reached
    assert np.linalg.norm(runner.result().root[-1, :2] - (0, -7)) < 0.3


def test_what_cannot_be_done_changes_nothing(model):
    wall = Cuboids([((0, -3.0), 0.0, [(-3, -3, 0)], [(3, 3, 2)])])
    runner = TakeRunner(model, TakeRequest(np.array((0.0, 2.0)), 0.0, [walk_to(0, 1.0)], wall))
    for _ in range(30):
        runner.step()
    goals = list(runner.director.goals)
    with pytest.raises(GoalError, match="cannot be reached"):
        runner.interrupt([walk_to(0, -3)])
    with pytest.raises(GoalError, match="give at least one"):
        runner.interrupt([])
    assert runner.director.goals == goals and runner.step()


def test_commands_fade_over_when_another_goal_breaks_in(model):
    runner = TakeRunner(model, TakeRequest(np.zeros(2), 0.0, [walk_to(0, -4)], Cuboids(), time_limit=12.0))
    while runner.frames < 60:
        assert runner.step()
    places = [runner.state.goal_position[0, PIVOT:].copy()]
    runner.interrupt([walk_to(3.0, 1.0)])
    for _ in range(2 * TURNING):
        runner.step()
        places.append(runner.state.goal_position[0, PIVOT:].copy())
    steps = np.abs(np.diff(places, axis=0)).max((1, 2))
    whole = np.abs(places[-1] - places[0]).max()
    assert whole > 2.0 and steps.max() < 0.35 * whole
    assert np.abs(places[TURNING][:, :2] - places[0][:, :2]).max() > 0.9 * whole, (
        "it is over within a third of a second"
    )
