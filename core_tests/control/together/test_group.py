"""Several characters: who waits, who is parted, and that nobody goes through others."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest
from nsm_core.control.together.group import Cast, GroupRunner
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.evaluation.furniture_goals import sit_goal
from nsm_core.model.inference.model import Model, load_model
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture

DEEPEST = 0.03  # metres


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def walk(x: float, y: float, heading: float = 0.0, hold: float = 0.1) -> Goal:
    return Goal("walk", "place", np.array((x, y, 0.0)), heading, hold)


def run(model: Model, solids: Cuboids, *cast: tuple[str, tuple, float, list[Goal]]) -> GroupRunner:
    group = GroupRunner(
        model,
        [
            Cast(name, TakeRequest(np.array(start), heading, goals, solids, seed=number))
            for number, (name, start, heading, goals) in enumerate(cast)
        ],
    )
    while group.frames < 60 * FPS and group.step():
        pass
    return group


def goals_of(group: GroupRunner) -> list:
    return [goal for take in group.results() for goal in take.goals]


def test_two_who_face_each_other_in_a_corridor_are_parted(model):
    """It is as wide as one, and has a nook in its middle."""
    low = [(-4.0, 0.5, 0.0), (-4.0, -0.7, 0.0), (1.2, -0.7, 0.0), (-0.6, -1.9, 0.0)]
    high = [(4.0, 0.7, 2.2), (-0.4, -0.5, 2.2), (4.0, -0.5, 2.2), (1.4, -1.7, 2.2)]
    corridor = Cuboids([((0, 0, 0), 0.0, low, high)])
    group = run(
        model,
        corridor,
        ("Anna", (-3.0, 0.0), np.pi / 2, [walk(3.2, 0.0, np.pi / 2)]),
        ("Ben", (2.2, 0.0), -np.pi / 2, [walk(-3.2, 0.0, -np.pi / 2)]),
    )
    assert all(goal.reached for goal in goals_of(group)), [g.reason for g in goals_of(group)]
    assert max(group.depths.values()) < DEEPEST
    waits = [wait for waits in group.waits() for wait in waits]
    assert max((w.frames for w in waits), default=0) < 25 * FPS  # one may step into the nook in time


def test_a_seat_that_is_never_left_is_told_in_one_sentence(model):
    chair = furniture.make("chair", np.random.default_rng(3))
    place = np.array((1.2, 0.0))
    seat = [sit_goal(chair, place, 0.0, hold=0.1) for _ in range(2)]
    group = run(
        model,
        furniture.cuboids([(chair, place, 0.0)]),
        ("Anna", (1.2, -1.6), 0.0, seat[:1]),
        ("Ben", (-0.6, -2.4), 0.0, [seat[1], walk(-0.8, -2.0)]),
    )
    anna, (missed, after) = (take.goals for take in group.results())
    assert anna[0].reached and after.reached and not missed.reached
    assert missed.reason == ("Anna stays at chair to the end; give Anna a further goal, or Ben another one.")
    assert "for Anna at chair" in group.waits()[1][0].sentence()
    assert max(group.depths.values()) < DEEPEST


def test_who_comes_to_a_place_where_another_stands_waits_until_it_has_left(model):
    group = run(
        model,
        Cuboids(),
        ("Anna", (0.0, 0.9), 0.0, [walk(0.0, 0.0, hold=0.8), walk(1.8, 0.6, np.pi / 2)]),
        ("Ben", (-2.2, 0.1), np.pi / 2, [walk(0.12, 0.1, np.pi / 2)]),
    )
    assert all(goal.reached for goal in goals_of(group)), [g.reason for g in goals_of(group)]
    assert max(group.depths.values()) < DEEPEST
    assert group.waits()[1][0].whom == "Anna"


def test_who_cannot_do_a_goal_is_named(model):
    walls = Cuboids([((2, 0, 0), 0.0, [(-0.6, -0.6, 0)] * 1, [(0.6, 0.6, 2)])])
    with pytest.raises(GoalError, match=r"^Ben: 'place' cannot be reached"):
        run(
            model,
            walls,
            ("Anna", (0.0, 0.0), 0.0, [walk(0.0, -1.0)]),
            ("Ben", (0.0, 2.0), 0.0, [walk(2.0, 0.0)]),
        )
