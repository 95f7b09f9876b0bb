"""The director: from a queue of goals to the series the network is led by."""

from __future__ import annotations

import numpy as np
import pytest
from puppets import ROOM, Puppet, cell

from nsm_core.body.skeleton import HIP_OVER_SEAT
from nsm_core.control.actions.approach import Ground
from nsm_core.control.actions.climb import Climb
from nsm_core.control.director import rotation_error
from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import GOAL_ACTIONS, STYLES
from nsm_core.errors import GoalError
from nsm_core.rotations import heading_to_direction
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene import furniture
from nsm_core.world.sensors.interaction import interaction_sensor

PAST = np.arange(-30, 0, 5)


def seat_goal(place=(0.0, -6.0), heading=0.0, hold=1.0, name="Chair") -> tuple[Goal, FloorPlan]:
    """A chair somewhere, its goal, and the plan of a room with it alone."""
    piece = furniture.make("chair", np.random.default_rng(0))
    query = furniture.cuboids([(piece, np.array(place), heading)])
    volume = interaction_sensor(query, np.append(place, piece.centre[2]), piece.size, heading)
    return Goal("sit", name, (*place, piece.seat.height + HIP_OVER_SEAT), heading, hold, volume), FloorPlan(
        query, ROOM
    )


def named(action: np.ndarray) -> list[str]:
    assert (action.sum(-1) == 1).all()
    return [GOAL_ACTIONS[k] for k in action.argmax(-1)]


def test_shapes_and_standing_before_the_first_goal_is_heard():
    p = Puppet([Goal("walk", "there", (5, 0, 0), 1.0)], root=(1.0, 2.0, 0.5)).run(1)
    assert p.position[0].shape == (13, 3) and p.heading[0].shape == (13,) and p.action[0].shape == (13, 6)
    assert p.director.index == -1 and named(p.action[0]) == ["idle"] * 13
    np.testing.assert_allclose(p.position[0], np.tile((1, 2, 0), (13, 1)))
    np.testing.assert_allclose(p.heading[0], 0.5)
    p.run(16)
    assert p.director.index == 0 and 4 <= p.director.results[0].start_frame <= 15


def test_locomotion_leads_to_a_far_seat_then_the_goal_itself_takes_over():
    goal, plan = seat_goal(heading=np.pi)  # it faces who comes
    p = Puppet([goal], plan=plan).run()
    ahead = [named(a[6:]) for a in p.action]
    led, sent = ahead.index(["walk"] * 7), ahead.index(["sit"] * 7)
    assert 4 <= led < sent and all(s == ["sit"] * 7 for s in ahead[sent:])
    stand = np.array((0.0, -5.55))
    distance = [np.linalg.norm(stand - r[:2]) for r in p.roots]
    assert distance[led] > 5 and 3.4 < distance[sent] < 3.7
    for f in range(led, sent):
        # Each key's goal lies one second further along the way than the key itself.
        away = np.linalg.norm(p.position[f][6:, :2] - p.roots[f][:2], axis=1)
        assert (np.diff(away) >= -1e-6).all() and 0.25 < away[0] < 1.6 and away[-1] < 3.0
        assert p.sensed[f] is None
    for f in range(sent, len(ahead)):
        np.testing.assert_allclose(p.position[f][6:], np.tile(goal.position, (7, 1)), atol=1e-6)
        assert (p.heading[f][6:] == goal.heading).all() and p.sensed[f] is goal.interaction
    result = p.director.results[0]
    assert result.reached and result.object == "Chair" and result.action == "sit"
    assert (
        result.seconds == pytest.approx((result.end_frame - result.start_frame) / 30) and result.seconds < 10
    )


def test_a_table_in_the_way_is_walked_around_before_the_goal_is_shown():
    table = furniture.make("table", np.random.default_rng(1), width=2.0, depth=0.7)
    query = furniture.cuboids([(table, np.array((0.0, -1.4)), 0.0)])
    p = Puppet([Goal("walk", "there", (0.0, -3.2, 0), 0.0)], plan=FloorPlan(query, ROOM)).run()
    led = [f for f, a in enumerate(p.action) if "walk" in named(a[6:])]
    assert len(led) > 30, "a goal within reach but behind a table needs leading"
    assert p.director.results[0].reached
    shown = np.concatenate([p.position[f][6:] for f in led]) + (0, 0, 0.7)
    assert query.signed_distance(shown.astype(np.float32), 2.0).min() > 0.2
    assert np.abs(shown[:, 0]).max() > 1.0
    assert named(p.action[-1][6:]) == ["idle"] * 7 and np.allclose(p.position[-1][6:], (0.0, -3.2, 0))
    straight = Puppet([Goal("walk", "there", (0.0, -3.2, 0), 0.0)]).run()
    assert "walk" not in named(np.concatenate([a[6:] for a in straight.action]))


def test_past_keys_keep_the_goals_of_their_time():
    goal, plan = seat_goal()
    p = Puppet(
        [goal, Goal("idle", "", np.zeros(3), 0.0, 0.5), Goal("walk", "back", (0, 0, 0), 2.0)], plan=plan
    ).run()
    switches = [f for f in range(1, len(p.action)) if named(p.action[f][6:7]) != named(p.action[f - 1][6:7])]
    assert len(switches) >= 3
    for f in range(30, len(p.position)):
        then = f + PAST
        np.testing.assert_array_equal(p.position[f][:6], [p.position[t][6] for t in then])
        np.testing.assert_array_equal(p.heading[f][:6], np.array([p.heading[t][6] for t in then]))
        np.testing.assert_array_equal(p.action[f][:6], [p.action[t][6] for t in then])
    f = switches[1]
    assert set(named(p.action[f][:6])) != set(named(p.action[f][6:]))


@pytest.mark.parametrize("hold", [0.0, 1.0, 2.5])
def test_goals_are_held_as_long_as_asked(hold):
    goal, plan = seat_goal((0.0, -2.5), hold=hold)
    p = Puppet([goal, Goal("walk", "away", (2.0, -4.0, 0), 0.0, 0.0)], plan=plan).run()
    first, second = p.director.results
    assert first.reached and second.reached and p.director.done
    assert second.start_frame - first.end_frame == max(1, round(hold * 30))
    assert second.start_frame < second.end_frame < len(p.position) + 1


def test_sitting_takes_a_rest_on_the_seat_and_not_a_label_alone():
    goal, plan = seat_goal((0.0, -2.5))
    p = Puppet([goal], plan=plan)
    p.obedient, p.sitting = False, 1.0  # says that it sits, metres from the seat
    p.run(200)
    assert not p.director.results[0].reached and p.director.results[0].seconds == 0
    p.root[:2], p.sitting = (0.0, -2.5), 0.5  # there, but not seated
    p.run(400)
    assert p.director.results[0].seconds == 0
    p.sitting = 1.0
    p.run(411)
    assert p.director.results[0].seconds == 0
    p.run(420)
    assert p.director.results[0].reached


def test_time_limit_ends_a_goal_and_goes_on_to_the_next():
    goal, plan = seat_goal()
    p = Puppet([goal, Goal("idle", "", np.zeros(3), 0.0, 0.0)], plan=plan, time_limit=3.0)
    p.obedient = False
    p.run()
    first, second = p.director.results
    assert (
        not first.reached
        and 3.0 < first.seconds < 3.1
        and first.end_frame - first.start_frame == round(first.seconds * 30)
    )
    assert second.reached and second.start_frame - first.end_frame <= 2 and p.director.done


def test_unreachable_goals_are_refused_in_a_sentence():
    p = Puppet([Goal("walk", "cell", (0, -5.5, 0), 0.0)], plan=FloorPlan(cell(), ROOM))
    with pytest.raises(GoalError, match=r"no free way .*\.$"):
        p.run()


def test_idle_from_sitting_asks_to_stand_before_the_seat():
    goal, plan = seat_goal((1.0, -2.0), heading=0.7, hold=0.5)
    p = Puppet([goal, Goal("idle", "", np.zeros(3), 0.0, 0.5)], plan=plan).run()
    idle = p.director.results[1]
    f = idle.start_frame + 1
    assert named(p.action[f][6:]) == ["idle"] * 7
    ahead = p.position[f][6, :2] - p.roots[f][:2]
    np.testing.assert_allclose(p.roots[f][:2], (1.0, -2.0), atol=0.05)
    np.testing.assert_allclose(ahead, 0.45 * heading_to_direction(np.array(0.7)), atol=0.05)
    assert p.heading[f][6] == pytest.approx(0.7, abs=0.05) and idle.reached
    assert p.sensed[f] is goal.interaction, "the seat is sensed while rising from it"
    assert p.sensed[-1] is None, "and forgotten once the sitter stands"
    standing = Puppet([Goal("idle", "", np.full(3, 7.0), 0.0, 0.5)], root=(0.3, 0.4, 1.0)).run()
    np.testing.assert_allclose(
        standing.position[-1][6], (0.3, 0.4, 0), atol=1e-6
    )  # where it is, not where the goal says


def test_the_same_seed_leads_the_same_way():
    def goals():
        return [Goal("walk", "far", (6.0, 1.0, 0), 0.4), Goal("walk", "home", (0, 0, 0), 2.0)]

    a, b, other = (Puppet(goals(), seed=s).run() for s in (3, 3, 4))
    assert len(a.position) == len(b.position)
    np.testing.assert_array_equal(np.array(a.position), np.array(b.position))
    np.testing.assert_array_equal(np.array(a.heading), np.array(b.heading))
    n = min(len(a.position), len(other.position))
    assert not np.array_equal(np.array(a.position[:n]), np.array(other.position[:n]))


def hot(action: np.ndarray) -> str:
    """Goal actions of one key, joined."""
    return "+".join(name for k, name in enumerate(GOAL_ACTIONS) if action[k] > 0.5)


@pytest.mark.parametrize(
    "distance, expected", [(8.0, {"run", "idle"}), (2.0, {"walk", "idle"}), (0.7, {"idle"})]
)
def test_runs_are_led_to_their_end_and_short_ones_walked(distance, expected):
    p = Puppet([Goal("run", "there", (0, -distance, 0), 0.3, 0.2)]).run()
    assert p.director.results[0].reached and {hot(k) for a in p.action for k in a[6:]} == expected
    if distance > 5:
        led = [f for f, a in enumerate(p.action) if "run" in {hot(k) for k in a[6:]}]
        ahead = [np.linalg.norm(p.position[f][6, :2] - p.roots[f][:2]) for f in led]
        assert max(ahead) > 1.8 and ahead[-1] < 1.8, "the course is fast, and slows down before its end"
        assert np.linalg.norm(p.roots[led[-1]][:2] - (0, -distance)) < 1.8


def step_goal(
    heading: float = 0.0, place=(0.0, -5.0), height: float = 0.3, hold: float = 0.2
) -> tuple[Goal, FloorPlan]:
    piece = furniture.make("step", np.random.default_rng(0), width=1.2, depth=0.8, height=height)
    query = furniture.cuboids([(piece, np.array(place), heading)])
    volume = interaction_sensor(query, np.append(place, piece.centre[2]), piece.size, heading)
    return Goal("climb", "Step", (*place, height), heading, hold, volume), FloorPlan(query, ROOM)


@pytest.mark.parametrize(
    "root, heading",
    [((0.0, 0.0, 0.0), 0.0), ((3.0, -6.0, 1.0), 0.4), ((-2.0, -4.5, 0.0), np.pi), ((0.3, -4.1, 2.0), 0.0)],
)
def test_steps_are_climbed_squarely_from_before_their_edge(root, heading):
    goal, plan = step_goal(heading)
    p = Puppet([goal, Goal("walk", "off", (0, 0.5, 0), 0.0, 0.1)], root=root, plan=plan)
    p.lifts = goal.position
    p.run()
    climb, walk = p.director.results
    assert climb.reached and walk.reached
    sent = [f for f, a in enumerate(p.action) if hot(a[6]) == "idle+walk"]
    ahead = heading_to_direction(np.array(heading))
    stand = goal.position[:2] - (0.4 + 0.6) * ahead
    at = p.roots[sent[0]][:2] - stand
    assert abs(at @ (-ahead[1], ahead[0])) < 0.31 and -1.65 < at @ ahead < 0.31
    for f in sent:
        np.testing.assert_allclose(p.position[f][6:], np.tile(goal.position, (7, 1)), atol=1e-6)
        assert p.sensed[f] is goal.interaction and (p.heading[f][6:] == np.float32(heading)).all()
    assert all(p.sensed[f] is None for f in range(sent[0])) and p.sensed[-1] is None


def test_a_climber_on_the_floor_has_not_arrived():
    goal, plan = step_goal()
    p = Puppet([goal], plan=plan, time_limit=8.0).run()  # hips stay at their height over the floor
    assert not p.director.results[0].reached


def test_multi_hot_commands_and_their_rest():
    from nsm_core.control.actions.approach import Command

    assert (
        Command("walk+carry").resting == "idle+carry"
        and Command("run").resting == "idle"
        and Command("walk").resting == "idle"
    )


@pytest.mark.parametrize(
    "make, words",
    [
        (
            lambda: Goal("fly", "x", np.zeros(3), 0.0),
            "'fly' is not one of sit, walk, idle, run, carry, open, climb",
        ),
        (lambda: Goal("sit", "Chair", (0, np.nan, 0), 0.0), "'Chair' has no usable place"),
        (lambda: Goal("sit", "Chair", (0, 0), 0.0), "'Chair' has no usable place"),
        (lambda: Goal("sit", "Chair", np.zeros(3), np.inf), "'Chair' has no usable place"),
        (lambda: Goal("sit", "Chair", np.zeros(3), 0.0, hold=-1), "'Chair' has a hold of -1"),
    ],
)
def test_bad_goals_are_refused_in_a_sentence(make, words):
    with pytest.raises(GoalError, match=rf"{words}.*\.$"):
        make()


def test_rotation_error_takes_the_short_way_round():
    assert rotation_error(np.pi - 0.05, -np.pi + 0.05) == pytest.approx(np.degrees(0.1))
    assert rotation_error(0.2, 0.2 + 4 * np.pi) == pytest.approx(0, abs=1e-6)


def test_a_goal_may_take_as_long_as_its_way_needs():
    p = Puppet([Goal("walk", "far", (0, -8.5, 0), 0.0)], root=(0.0, 8.5, 0.0), time_limit=4.0).run()
    result = p.director.results[0]
    assert result.reached and result.seconds > 13  # 17 m at 1.2 m/s


def test_who_makes_no_progress_is_given_up_where_one_stands():
    p = Puppet([Goal("walk", "far", (0, -8.5, 0), 0.0)], root=(0.0, 8.5, 0.0), time_limit=4.0).run(300)
    stuck, p.obedient, p.speed = len(p.position), False, 0.0
    p.run()
    result = p.director.results[0]
    assert not result.reached and 3.5 < (result.end_frame - stuck) / 30 < 4.2


def test_who_stands_on_what_is_climbed_walks_on_up_there():
    block = Cuboids([((0, 0, 0), 0.0, np.array(((-1.5, -1.0, 0.0),)), np.array(((1.5, 1.0, 0.4),)))])
    volume = interaction_sensor(block, np.array((0.0, 0.0, 0.2)), np.array((3.0, 2.0, 0.4)), 0.0)
    goal = Goal("climb", "podium", np.array((0.6, 0.3, 0.4)), np.pi / 2, 0.0, volume)
    style = np.zeros(len(STYLES), np.float32)
    for place, height, up in (
        ((-0.6, 0.0), 1.33, True),
        ((-0.6, 0.0), 0.93, False),
        ((-2.5, 0.0), 1.33, False),
    ):
        stage = Climb(goal, Ground(None, np.random.default_rng(0)))
        moment = Moment(np.array((*place, 0.3), np.float32), np.append(place, height), 0.3, 0.0, style)
        stage.update(moment)
        assert stage.approach.given == up
        stage.update(moment)
        assert (stage.approach.stand == goal.position[:2]).all() == up
