"""Things that one at a time can use: who has them, in which order, and until when."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest
from nsm_core.control.together.group import Cast, GroupRunner
from nsm_core.control.together.player import Ahead
from nsm_core.evaluation.furniture_goals import sit_goal
from nsm_core.evaluation.trials.rooms import Room, goal_of
from nsm_core.model.inference.model import Model, load_model
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture
from nsm_core.world.scene.door import make_door


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def cast(name: str, start: tuple[float, float], goals: list[Goal], solids: Cuboids) -> Cast:
    return Cast(name, TakeRequest(np.array(start), 0.0, goals, solids))


def walk(x: float, y: float) -> Goal:
    return Goal("walk", "place", np.array((x, y, 0.0)), 0.0, 0.1)


@pytest.fixture
def sitters(model: Model) -> GroupRunner:
    """Three who want one chair, each at a place of its own, and at their first goals."""
    chair = furniture.make("chair", np.random.default_rng(3))
    place, solids = np.array((0.0, 2.0)), furniture.cuboids([(chair, np.array((0.0, 2.0)), 0.0)])
    starts = {"Anna": (-1.0, 0.0), "Ben": (0.0, -0.6), "Chloe": (1.0, 0.0)}
    group = GroupRunner(
        model,
        [
            cast(n, at, [sit_goal(chair, place, 0.0, hold=0.1), walk(at[0], -1.0)], solids)
            for n, at in starts.items()
        ],
    )
    for player in group.players:
        player.runner.director.index = 0
    return group


def comes(player, seconds: float) -> None:
    """Have a player see its way to the thing as one of so many seconds."""
    player.ahead = Ahead(np.stack((player.place, (0.0, 2.0))), np.array((0.0, seconds)))


def stand(player, x: float, y: float) -> None:
    player.runner.state.root[0, :2] = x, y


def test_a_thing_goes_by_the_line_and_waiting_in_a_line_that_moves_on_is_not_in_vain(sitters):
    anna, ben, chloe = sitters.players
    claims = sitters._traffic.claims
    for player, seconds in ((anna, 9.0), (ben, 2.0), (chloe, 3.9)):
        stand(player, player.place[0], -3.0)
        comes(player, seconds)
    waiting = claims.update()
    seat = claims.taken()[0]
    assert seat.holder is ben and [who for who, *_ in waiting] == [anna, chloe]
    comes(anna, 1.0)  # nearer now than Chloe, who stands in line already
    claims.update()
    assert claims.before(anna, chloe) is chloe and claims.before(anna, ben) is ben
    anna.patience[0] = chloe.patience[0] = 600
    claims.update()
    assert anna.patience[0] == 600
    ben.runner.director.index = 1
    stand(ben, 0.0, -1.0)
    claims.update()
    assert seat.holder is chloe and anna.patience[0] == chloe.patience[0] == 0
    assert claims.before(anna, ben) is None


def test_a_seat_is_free_once_who_had_it_stands_beside_it_to_the_end(sitters):
    anna, ben, chloe = sitters.players
    claims = sitters._traffic.claims
    for player, seconds in ((anna, 2.0), (ben, 1.0), (chloe, 3.0)):
        comes(player, seconds)
    claims.update()
    seat = claims.taken()[0]
    assert seat.holder is ben
    ben.runner.director.index = 1
    stand(ben, 0.0, 1.15)
    claims.update()
    assert seat.holder is ben  # on its way from there
    ben.runner.director.done = True
    claims.update()
    assert seat.holder is anna


def test_who_stands_but_has_a_way_to_go_to_where_it_waits_does_not_wait_there_yet(sitters):
    anna, traffic = sitters.players[0], sitters._traffic
    comes(anna, 3.0)
    anna.still = 20
    assert not traffic._waits_there(anna, {anna.order: 0.0})  # it does not give way at all
    anna.halt(0.0)
    assert traffic._waits_there(anna, {anna.order: 0.1})
    assert not traffic._waits_there(anna, {anna.order: 1.8}) and not traffic._waits_there(anna, {})
    anna.still = 2
    assert not traffic._waits_there(anna, {anna.order: 0.1})


def test_a_leaf_that_one_after_the_other_moves_is_where_it_is_for_all(model):
    door = make_door(np.random.default_rng(2), near=3.0, far=3.0)
    leaf = door.leaf((-door.width / 2, 0.0, 0.0, 0.0), 1.0)
    solids = furniture.cuboids([(door.wall, np.array((-door.width / 2, 0.0)), 0.0)])
    goal = goal_of(Room(still=[], leaf=leaf), "open", np.random.default_rng(0))
    group = GroupRunner(
        model, [cast(n, (x, -2.0), [goal], solids) for n, x in (("Anna", -1.0), ("Ben", 0.0), ("Eve", 1.0))]
    )
    leaves = [player.runner.props[leaf.name] for player in group.players]
    assert len({id(own) for own in leaves}) == 3
    for turn, own in enumerate((leaves[0], leaves[1], leaves[1], leaves[2], leaves[0])):
        own.pose[3] = own.closed + own.swing * 0.2 * (turn + 1)  # as hands move it: in place
        group._share()
        assert [each.angle for each in leaves] == pytest.approx([0.2 * (turn + 1)] * 3)
