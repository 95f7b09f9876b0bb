"""Pick and place: a jar goes from one board to another in one hand, and what cannot be is told."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.actions.place import planned
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.conventions import HAND_CONTACTS
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import all_depths, thing_in_solids, wrists
from nsm_core.model.inference.model import load_model
from nsm_core.world.geometry.distance import Cuboids, Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.small_things import make_thing
from nsm_core.world.sensors.environment import environment_sensor

SHELF = ((-0.4, 0.0, 0.95), (0.4, 0.3, 0.98)), ((-0.4, 0.0, 1.35), (0.4, 0.3, 1.38)), (
    (-0.4, 0.3, 0.0), (0.4, 0.32, 1.8)
)  # fmt: skip
TABLE = (((1.0, -1.6, 0.72), (2.0, -0.9, 0.75)),)
PLACE = np.array((1.2, -1.25, 0.75))


def boards(*more):
    parts = [*SHELF, *TABLE, *more]
    return Cuboids([((0, 0, 0), 0.0, [p[0] for p in parts], [p[1] for p in parts])])


def jar(pose=(0.05, 0.1, 0.98, 0.4)):
    return make_thing("jar", np.random.default_rng(1), pose)


@pytest.fixture(scope="module")
def placed():
    goal = Goal("place", "Jar", PLACE, 0.0, 0.2, prop=jar())
    asked = TakeRequest(np.array((0.0, -1.6)), 0.3, [goal], boards(), seed=2)
    runner = TakeRunner(load_model(backend="numpy"), asked)
    while runner.frames < 900 and runner.step():
        pass
    return asked, runner.result()


def test_the_jar_is_put_where_it_should_be_and_the_hand_has_held_it(placed):
    asked, take = placed
    (goal,) = take.goals
    assert goal.reached and goal.position_error_cm < 0.1 and goal.hand_error_cm < 1.0
    poses = take.props["jar"]
    np.testing.assert_allclose(poses[0], jar().pose)
    np.testing.assert_allclose(poses[-1, :3], PLACE, atol=1e-6)
    moving = np.flatnonzero(np.abs(np.diff(poses, axis=0)).max(1) > 1e-6)
    # It moves while a hand has it, and never else.
    hands = wrists(take.hips_position, take.local_rotations)[moving]
    off = np.linalg.norm(hands - poses[moving, None, :3] - (0, 0, asked.goals[0].prop.size[2] / 2), axis=-1)
    assert off.min(1).max() < 0.25
    held = take.contacts[:, HAND_CONTACTS].max(1) > 0.5
    assert held[moving].mean() > 0.95 and not held[: moving[0] - 12].any()


def test_nothing_is_touched_on_the_way(placed):
    asked, take = placed
    thing = asked.goals[0].prop
    depths = all_depths(
        take.hips_position, take.local_rotations, asked.environment, {"jar": thing}, take.props
    )
    assert depths.max() < 0.02
    assert thing_in_solids(thing, take.props["jar"], asked.environment) < 0.01


def test_what_is_in_the_hand_is_not_shied_away_from(placed):
    asked, take = placed
    poses = take.props["jar"]
    moving = np.flatnonzero(np.abs(np.diff(poses, axis=0)).max(1) > 1e-6)
    sensed, held = [], len(moving) // 2
    for frame in (1, moving[held]):
        seen = take.insights[frame]
        alone = environment_sensor(asked.environment, seen.root[:2], float(seen.root[2]))
        sensed.append(np.abs(seen.environment / 255 - alone).max())
    assert sensed[0] > 0.2 and sensed[1] < 0.01
    # So one stands while the hand takes it and draws it out.
    drawn = take.root[moving[0] - 15 : moving[0] + 25]
    assert np.linalg.norm(drawn[:, :2] - drawn[0, :2], axis=1).max() < 0.08


def refused(thing, place=PLACE, solids=None):
    solids = solids or boards()
    plan = FloorPlan(solids, (np.array((-2.0, -4.0)), np.array((4.0, 2.0))))
    with pytest.raises(GoalError) as error:
        planned(Goal("place", thing.name, place, 0.0, prop=thing), solids, plan, np.array((0.0, -2.0)))
    return str(error.value)


def test_what_no_hand_takes_is_told_in_a_sentence():
    high = Union([boards(), boards(((-0.4, 0.0, 2.2), (0.4, 0.3, 2.23)))])
    assert "2.31 m over the floor, and one hand takes things between 0.4 and 2.0 m" in refused(
        jar((0.05, 0.1, 2.23, 0.4)), solids=high
    )
    heavy = jar()
    heavy.mass = 5.0
    assert "weighs 5.0 kg, too much for one hand" in refused(heavy)
    large = jar()
    large.high = large.high + (0.3, 0, 0)
    assert "too large for one hand" in refused(large)
    assert "The place of jar is out of reach" in refused(jar(), np.array((1.2, -1.25, 2.3)))
    sides = [((x - 0.02, 0.0, 0.98), (x, 0.3, 1.35)) for x in (-0.38, 0.4)]
    shut = boards(((-0.4, -0.02, 0.95), (0.4, 0.0, 1.38)), *sides)
    assert "move" in (told := refused(jar(), solids=shut)) and "jar" in told
