"""Goals that are reached when they should be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.control.timing import PACES, WARP, played_in_time, retimed, rounds
from nsm_core.conventions import FPS
from nsm_core.model.inference.model import Model, load_model
from nsm_core.world.geometry.distance import Cuboids


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def walk(y: float, **more) -> Goal:
    return Goal("walk", "place", np.array((0.0, y, 0.0)), 0.0, hold=0.2, **more)


def perform(model: Model, goals: list[Goal]) -> tuple[TakeResult, list[Goal], int]:
    """The take, its goals as they were performed at last, and how often it was performed."""
    asked, runs = TakeRequest(np.zeros(2), 0.0, goals, Cuboids(), seed=3), 0
    while True:
        runner, runs = TakeRunner(model, asked), runs + 1
        while not runner.director.done:
            runner.step()
        better = retimed(asked.goals, runner.director.results)
        if better is None or runs > rounds(goals):
            return played_in_time(runner.result(), asked.goals), asked.goals, runs
        asked = replace(asked, goals=better)


def joints_of(take: TakeResult) -> np.ndarray:
    return forward_kinematics(take.hips_position.astype(float), take.local_rotations.astype(float))[0]


@pytest.fixture(scope="module")
def usual(model) -> float:
    take, _, runs = perform(model, [walk(-3.0)])
    assert runs == 1
    return take.goals[0].end_frame / FPS


def test_a_little_is_played_slower(model, usual):
    take, goals, runs = perform(model, [walk(-3.0, by=usual * (1 + 0.5 * WARP))])
    assert runs == 1 and goals[0].wait == 0 and goals[0].pace == 1
    assert take.goals[0].end_frame / FPS == pytest.approx(goals[0].by, abs=1 / FPS)
    assert len(take.hips_position) == len(take.root) == len(take.contacts) == len(take.action)
    # Feet that stand keep their places.
    toes = joints_of(take)[:, TOES]
    slide = np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1) * FPS
    assert np.percentile(slide[toes[1:, :, 2] < 0.0255], 90) < 0.01


def test_much_is_waited_for(model, usual):
    take, goals, _ = perform(model, [walk(-3.0, by=usual + 3.0)])
    assert take.goals[0].reached and take.goals[0].late == 0
    assert take.goals[0].end_frame / FPS == pytest.approx(goals[0].by, abs=1 / FPS)
    assert goals[0].wait > 2
    still = take.hips_position[: round(2 * FPS), :2]
    assert np.abs(still - still[0]).max() < 0.1


def test_what_is_too_soon_is_gone_faster_and_told(model, usual):
    take, goals, _ = perform(model, [walk(-3.0, by=usual - 2.5)])
    assert goals[0].pace == pytest.approx(PACES[1]) and take.goals[0].reached
    assert take.goals[0].end_frame / FPS < usual - 0.2
    assert take.goals[0].late == pytest.approx(take.goals[0].end_frame / FPS - goals[0].by, abs=1e-6)
    assert take.goals[0].late > 0.3
