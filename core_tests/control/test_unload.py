"""A box in the hands when another goal breaks in is set down, or carried along, as asked."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRunner
from nsm_core.errors import GoalError
from nsm_core.evaluation.trials import carry
from nsm_core.model.inference.model import Model, load_model


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def interrupted(model: Model, goal: Goal) -> tuple[TakeRunner, np.ndarray, int]:
    """A take in which ``goal`` breaks in a second after a box was lifted; the box's poses (T, 4) and when."""
    trial = carry.trials(1, 1)[0]
    asked = carry.request(trial, contact_ik=True)
    runner = TakeRunner(model, asked)
    since = 0
    while since < 30:
        since += any(getattr(g, "state", "") == "held" for g in runner.director.grasps)
        assert runner.frames < 600 and runner.step()
    at = runner.frames
    runner.interrupt([goal])
    while runner.frames < at + 450 and not runner.director.done:
        assert runner.step()
    return runner, runner.poses_of("Box"), at


def test_it_is_set_down_before_another_goal(model):
    place = np.array((2.5, 2.5, 0.0))
    runner, poses, at = interrupted(model, Goal("walk", "away", place, 0.0, 0.1))
    prop = runner.props["Box"]
    assert runner.director.results[-1].reached
    assert abs(poses[-1, 2] - prop.size[2] / 2) < 0.03, "it stands on the floor"
    sinks = np.diff(poses[at:, 2]).min() * 30
    assert sinks > -2.5, "hands bring it down: what falls a metre comes to 4 m/s"
    assert np.linalg.norm(runner.state.root[0, :2] - poses[-1, :2]) > 1.0


def test_it_is_carried_along_where_that_is_asked_and_set_down_by_the_next(model):
    place = np.array((2.0, 1.5, 0.0))
    runner, poses, _ = interrupted(model, Goal("walk", "there", place, 0.0, 0.1, load="along"))
    root = runner.state.root[0]
    assert runner.director.results[-1].reached and np.linalg.norm(root[:2] - place[:2]) < 0.35
    assert poses[-1, 2] > 0.6 and np.linalg.norm(poses[-1, :2] - root[:2]) < 0.8, "it is in the hands"
    runner.interrupt([Goal("idle", "here", np.append(root[:2], 0.0), 0.0, 0.1)])
    while not runner.director.done:
        assert runner.step()
    assert abs(runner.poses_of("Box")[-1, 2] - runner.props["Box"].size[2] / 2) < 0.03


def test_a_load_that_nobody_knows():
    with pytest.raises(GoalError, match="down or along"):
        Goal("walk", "x", np.zeros(3), 0.0, load="thrown")
