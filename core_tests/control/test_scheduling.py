"""Several things to bring: two are carried at once where that is quicker, and each is told by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nsm_core.control.goals import Goal
from nsm_core.control.key_poses import WEIGHT, KeyPose, cost, deviation
from nsm_core.control.scheduling import scheduled
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.evaluation.measures.objects import all_depths, wrists
from nsm_core.model.inference.model import load_model
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.small_things import make_thing

BOARDS = (
    ((-0.4, 0.0, 0.95), (0.4, 0.3, 0.98)),
    ((-0.4, 0.0, 1.35), (0.4, 0.3, 1.38)),
    ((-0.4, 0.3, 0.0), (0.4, 0.32, 1.8)),
    ((1.0, -1.6, 0.72), (2.0, -0.9, 0.75)),
)
PLACES = {"jar": (1.2, -1.25, 0.75), "mug": (1.5, -1.23, 0.75)}


def room():
    return Cuboids([((0, 0, 0), 0.0, [low for low, _ in BOARDS], [high for _, high in BOARDS])])


def goals(**more):
    stands = {"jar": (0.05, 0.1, 0.98, 0.4), "mug": (-0.2, 0.12, 0.98, 0.0)}
    things = {name: make_thing(name, np.random.default_rng(1), pose) for name, pose in stands.items()}
    return [
        Goal("place", name, np.array(PLACES[name]), 0.0, 0.2, prop=thing, **more)
        for name, thing in things.items()
    ]


def asked(**more):
    return TakeRequest(np.array((0.0, -1.6)), 0.3, goals(), room(), seed=2, **more)


@pytest.fixture(scope="module")
def brought():
    request = asked()
    runner = TakeRunner(load_model(backend="numpy"), request)
    while runner.frames < 900 and runner.step():
        pass
    return request, runner.result()


def test_each_thing_comes_to_its_place_and_is_told_by_itself(brought):
    request, take = brought
    assert [result.object for result in take.goals] == ["jar", "mug"]
    for result in take.goals:
        assert result.reached and result.position_error_cm < 0.1 and result.hand_error_cm < 1.0
        assert "carried at once, taken and put down at the same moment." in result.remarks[0]
        np.testing.assert_allclose(take.props[result.object][-1, :3], PLACES[result.object], atol=1e-6)
    things = {goal.name: goal.prop for goal in request.goals}
    depths = all_depths(take.hips_position, take.local_rotations, request.environment, things, take.props)
    assert depths.max() < 0.02


def test_both_hands_work_at_the_same_moment(brought):
    _, take = brought
    first = [np.flatnonzero(np.abs(np.diff(poses, axis=0)).max(1) > 1e-6) for poses in take.props.values()]
    assert abs(first[0][0] - first[1][0]) < 15 and abs(first[0][-1] - first[1][-1]) < 15
    # Who has put both down stays there.
    last = max(moved[-1] for moved in first)
    assert np.linalg.norm(take.root[last:, :2] - take.root[last, :2], axis=1).max() < 0.15


def test_what_one_hand_has_follows_it_while_the_other_works(brought):
    _, take = brought
    hands = wrists(take.hips_position, take.local_rotations)
    used = {result.object: result.taken.hands[0] for result in take.goals}
    assert sorted(used.values()) == [0, 1]
    moves = {name: np.abs(np.diff(poses, axis=0)).max(1) > 1e-6 for name, poses in take.props.items()}
    both = np.flatnonzero(moves["jar"] & moves["mug"])
    walked = np.linalg.norm(take.root[both[-1], :2] - take.root[both[0], :2])
    assert len(both) > 60 and walked > 0.6
    # The first is put down while the other stays in its hand, which is as far off it as before.
    for name, hand in used.items():
        off = np.linalg.norm(hands[both, hand] - take.props[name][both, :3], axis=1)
        assert np.ptp(off) < 0.02


def test_things_out_of_reach_of_one_place_are_taken_one_after_the_other():
    jar, mug = goals()
    mug.prop.pose[0] = -1.3
    wide = Cuboids(
        [
            (
                (0, 0, 0),
                0.0,
                [(x - 1.4, y, z) if z < 1.4 and x < 0 else (x, y, z) for (x, y, z), _ in BOARDS],
                [high for _, high in BOARDS],
            )
        ]
    )
    plan = FloorPlan(wide, (np.array((-5.0, -6.0)), np.array((6.0, 4.0))))
    found = scheduled([jar, mug], plan, np.array((0.0, -1.6, 0.3)), wide).goals
    both = found[0].both
    assert both is not None and found[1].both is both and both.at_once == (False, True)
    # One comes from the further one past the nearer one to the table.
    assert [thing.name for thing in both.things] == ["mug", "jar"]


def test_in_order_one_is_brought_after_the_other():
    model = load_model(backend="numpy")
    assert all(goal.both is None for goal in TakeRunner(model, asked(in_order=True)).director.goals)


def test_what_is_broken_off_is_let_go_by_both_hands():
    runner = TakeRunner(load_model(backend="numpy"), asked())
    while sum(hold.bears > 0 for hold in runner.director.grasps) < 2:
        assert runner.step()
    away = Goal("walk", "Away", np.array((0.0, -3.0, 0.0)), 0.0, 0.2)
    runner.interrupt([away])
    for _ in range(90):
        runner.step()
    heights = [pose[2] for pose in runner.prop_poses().values()]
    assert all(min(abs(height - board) for board in (0.0, 0.75, 0.98)) < 0.01 for height in heights)
    assert not any(hold.bears for hold in runner.director.grasps)


def test_a_goal_with_a_time_keeps_its_turn():
    one, other = goals()
    plan = FloorPlan(room(), (np.array((-4.0, -6.0)), np.array((6.0, 4.0))))
    kept = scheduled([replace(one, by=20.0), other], plan, np.array((0.0, -1.6, 0.3)), room())
    assert kept.asked == [0, 1] and all(goal.both is None for goal in kept.goals)


def test_the_cost_is_that_of_equation_24():
    now, one, two = (KeyPose.of(np.array((x, 0.0, 0.0)), {}, set()) for x in (0.0, 1.0, 3.0))
    assert deviation(now, now) == pytest.approx(0.0, abs=1e-6)
    assert deviation(now, one) == pytest.approx(3.0)  # each of three joints by a metre
    assert cost(now, [one, two]) == pytest.approx(3.0 + WEIGHT * 6.0)
    turned = KeyPose.of(np.array((0.0, 0.0, np.pi)), {}, set())
    assert deviation(now, turned) > 0.5
