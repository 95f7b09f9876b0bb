"""Takes on stairs: the floor of the walker rises with the flight, and feet stand on the treads."""

import numpy as np
import pytest

from nsm_core.control.actions.approach import Ground
from nsm_core.control.goals import Goal
from nsm_core.control.relief import Relief
from nsm_core.errors import GoalError
from nsm_core.evaluation.trials import stairs as trial
from nsm_core.evaluation.trials.together import alone
from nsm_core.model.inference.model import load_model
from nsm_core.world.geometry.distance import Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.planning.path import Course
from nsm_core.world.scene import furniture
from nsm_core.world.scene.stairs import Stairs
from nsm_core.world.scene.terrain import Terrain

UP, DOWN = (next(t for t in trial.trials(1) if t.name == f"3 steps {way}") for way in ("up", "down"))


def plan_of(asked, *more):
    query = Union([asked.environment, *more])
    return FloorPlan(query, (np.full(2, -6.0), np.full(2, 6.0)), stairs=asked.stairs)


def test_ways_lead_over_a_flight_by_its_ends_alone():
    asked, flight = trial.request(UP), UP.flight
    plan = plan_of(asked)
    way = plan.find(flight.at(-1.5, 1.0), asked.goals[0].position[:2])
    own = flight.local(way)
    over = (own[:, 0] > 0) & (own[:, 0] < flight.length)
    assert over.any() and np.abs(own[over, 1]).max() < flight.width / 2 - 0.2
    # From beside the flight one goes around to its foot.
    beside = flight.local(plan.find(flight.at(0.2, flight.width / 2 + 0.5), asked.goals[0].position[:2]))
    assert beside[:, 0].min() < -0.1
    with pytest.raises(GoalError):
        FloorPlan(asked.environment, plan.bounds).require_way(way[0], way[-1])
    wall = furniture.make("wall", np.random.default_rng(0), width=3.0, depth=0.1, height=2.5)
    shut = furniture.cuboids([(wall, flight.at(flight.length / 2), flight.heading)])
    with pytest.raises(GoalError):
        plan_of(asked, shut).require_way(way[0], way[-1])


def test_courses_are_slower_on_flights_and_the_goal_itself_is_given_behind_them():
    asked, flight = trial.request(UP), UP.flight
    ground = Ground(plan_of(asked), np.random.default_rng(0))
    start, end = flight.at(-1.0), flight.at(flight.length + 1.0)
    assert not ground.free(start, end) and ground.free(flight.at(flight.length + 0.5), end)
    line = start + np.linspace(0, 1, 80)[:, None] * (end - start)
    course = Course(line, flight.heading, 1.2, most=asked.stairs.pace(line, 1.2))
    places, _, pace = course.preview(1.2, tuple(range(0, 121, 5)))
    on = flight.holds(places, 0.0)
    assert on.sum() > 2 and pace[on].max() < 0.55 and pace.max() > 0.8


def test_goals_up_there_lie_on_the_floor_of_the_walker():
    asked, flight = trial.request(UP), UP.flight
    relief = Relief(Terrain(), flight.at(-1.0), asked.stairs)
    assert relief.level == 0
    np.testing.assert_allclose(relief.goals(asked.goals[0].position[None])[0, 2], 0)
    seat = asked.goals[0].position[None] + (0, 0, 0.5)
    np.testing.assert_allclose(relief.goals(seat)[0, 2], flight.rise + 0.5, atol=1e-5)
    for along in np.linspace(-0.5, flight.length + 1, 20):
        assert relief.follow(flight.at(along)) == pytest.approx(float(flight.level(np.array(along))))
    assert not Stairs().lead_to(np.ones(3)) and asked.stairs.lead_to(asked.goals[0].position)


@pytest.mark.parametrize("each", [UP, DOWN], ids=lambda t: t.name)
def test_a_flight_is_walked_with_feet_on_the_treads(each):
    take, report = alone(trial.run_trial(load_model(backend="numpy"), each))
    assert report["passed"] and take.goals[0].reached
    assert report["on_treads"] >= 0.5 and report["penetration_cm"] < 6
    rise = take.hips_position[-1, 2] - take.hips_position[0, 2]
    assert rise == pytest.approx(each.flight.rise * (1 if each.up else -1), abs=0.08)


def test_a_climb_to_a_landing_is_one_along_the_stairs():
    asked = trial.request(UP)
    goal = Goal("climb", "Podium", np.append(UP.flight.at(-3.0), 0.4), 0.0)
    assert asked.stairs.lead_to(asked.goals[0].position) and not asked.stairs.lead_to(goal.position)
