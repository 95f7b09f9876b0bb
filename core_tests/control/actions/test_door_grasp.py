"""Doors at run time: a scripted character pushes and pulls leaves of either hinge and passes; the leaf gives
way, and stays.
"""

from __future__ import annotations

import numpy as np
import pytest
from actors import Actor, drive

from nsm_core.body.skeleton import INDEX, J
from nsm_core.control.actions.door_grasp import (
    EDGE_HEIGHT,
    EDGE_IN,
    FASTEST,
    WIDE_OPEN,
    Opening,
    require_room,
)
from nsm_core.control.actions.hold import SeenBody
from nsm_core.control.actions.leaf_room import NEARLY, LeafRoom, leaf_spheres
from nsm_core.control.goals import Goal
from nsm_core.conventions import GOAL_ACTIONS
from nsm_core.errors import GoalError
from nsm_core.rotations import wrap_angle
from nsm_core.world.affordances.passage import passage
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Leaf, sense

WIDTH = 0.85
MIDDLE = np.array((WIDTH / 2, -2.0, 0.0))
WRISTS = [INDEX["RightWrist"], INDEX["LeftWrist"]]
WALL = Cuboids(
    [
        (
            (0, -2),
            0.0,
            np.array([(-2, -0.06, 0), (WIDTH + 0.01, -0.06, 0)]),
            np.array([(-0.01, 0.06, 2.4), (WIDTH + 2, 0.06, 2.4)]),
        )
    ]
)
NORTH, SOUTH = (0.4, 0.2, 0.0), (0.4, -4.4, np.pi)


def door(swing: float = 1.0) -> Leaf:
    low, high = np.array((0, -0.02, 0.01)), np.array((WIDTH, 0.02, 2.03))
    query = Cuboids([((0, 0, 0), 0.0, low[None], high[None])])
    pose = np.array((0.0, -2.0, 0.0, 0.0))
    return Leaf(
        "Door",
        query,
        sense(query, low, high),
        pose,
        WIDTH,
        np.array((WIDTH - 0.07, 0, 1.0)),
        0.12,
        swing,
        0.0,
    )


def goal(leaf: Leaf, hold: float = 0.3) -> Goal:
    return Goal("open", leaf.name, MIDDLE, 0.0, hold, prop=leaf)


@pytest.fixture(
    scope="module",
    params=[(s, at) for s in (1.0, -1.0) for at in (NORTH, SOUTH)],
    ids=lambda p: f"{p[0]:+.0f} {p[1][1]}",
)
def passed(request) -> tuple[Actor, float]:
    swing, start = request.param
    off = Goal("walk", "off", (0.4, 2 * MIDDLE[1] - start[1], 0), start[2], 0.1)
    return drive([goal(door(swing)), off], solids=WALL, root=start, error=(0.01, 0.02, -0.02)), swing


def states(actor: Actor) -> list[str]:
    return [f["state"][0] if f["state"] else "" for f in actor.frames]


def test_door_is_passed_and_stays_open(passed):
    actor, swing = passed
    opened, walked = actor.director.results
    assert opened.reached and walked.reached
    way = passage(door(swing), actor.frames[0]["root"][:2])
    there = actor.frames[opened.end_frame]["root"]
    assert np.linalg.norm(there[:2] - way.beyond) < 0.35
    angle = swing * actor.track("Door")[:, 3]
    assert np.radians(74) < angle[-1] < WIDE_OPEN + 0.02 and np.ptp(angle[-10:]) == 0
    assert actor.hand_errors(0)[0] < 1 and 1 < opened.network_hand_error_cm < 8


def test_leaf_never_closes_and_never_flies(passed):
    actor, swing = passed
    angle = swing * actor.track("Door")[:, 3]
    assert np.diff(angle).min() > -1e-9 and np.diff(angle).max() * 30 <= FASTEST + 1e-6
    assert np.abs(np.diff(angle, 2)).max() * 900 < 45
    held = states(actor).index("held")
    assert np.ptp(angle[: held + 1]) == 0, "it stays shut until a hand holds it"


def test_a_leaf_let_go_only_slows_down_unless_the_body_moves_it(passed):
    actor, swing = passed
    angle, led = swing * actor.track("Door")[:, 3], states(actor)
    let_go = len(led) - 1 - led[::-1].index("held")
    way = passage(door(swing), actor.frames[0]["root"][:2])
    assert angle[let_go] > np.radians(60) and angle[-1] - angle[let_go] < np.radians(40 if way.push else 25)
    leaf, step = door(swing), np.diff(angle)
    room = LeafRoom(leaf)
    for k in range(let_go + 2, len(step)):
        leaf.pose = actor.frames[k]["props"]["Door"]
        touched = any(
            room.limits(*leaf_spheres(SeenBody(*actor.frames[n]["network"], np.zeros((2, 3))))[0], NEARLY)[0]
            > leaf.angle
            for n in (k, k + 1)
        )
        assert touched or step[k] <= max(step[k - 1] - 1e-6, 0), f"frame {k}: it gains speed by itself"


def test_hand_stays_on_the_moving_handle(passed):
    actor, swing = passed
    way = passage(door(swing), actor.frames[0]["root"][:2])
    leaf = door(swing)
    gaps = []
    led = (
        actor.joints[:, WRISTS[way.hand]] - actor.post.beside[:, way.hand]
    )  # with the handle across the palm
    for frame, wrist, state in zip(actor.frames, led, states(actor), strict=True):
        if state == "held":
            leaf.pose = frame["props"]["Door"]
            # Who pulls may slide from the handle to the free edge.
            on_leaf = leaf.to_local(wrist) - leaf.to_local(leaf.grip(way.side))
            slid = np.array(
                (0.0, 0.0, 0.0)
                if way.push
                else (leaf.width - EDGE_IN - leaf.handle[0], 0.0, EDGE_HEIGHT - leaf.handle[2])
            )
            gaps.append(
                np.linalg.norm(on_leaf - np.clip(on_leaf @ slid / max(slid @ slid, 1e-9), 0, 1) * slid)
            )
    assert len(gaps) > 10 and np.median(gaps) < 0.01 and max(gaps) < 0.07
    step = np.linalg.norm(np.diff(actor.joints[:, WRISTS], axis=0), axis=2)
    assert step.max() * 30 < 3.0


def test_commands_are_those_of_the_training_data(passed):
    actor, swing = passed
    way, leaf = passage(door(swing), actor.frames[0]["root"][:2]), door(swing)
    told = []
    for f in actor.frames[1 : actor.director.results[0].end_frame]:
        position, heading, action, _ = f["series"]
        hot = "+".join(n for k, n in enumerate(GOAL_ACTIONS) if action[6, k] > 0.5)
        if "open" in hot and (not told or told[-1][0] != hot):
            told.append((hot, position[6], heading[6]))
    assert [t[0] for t in told] == (["open", "walk+open"] if way.push else ["open", "idle+open", "walk+open"])
    np.testing.assert_allclose(told[0][1], leaf.grip(way.side, 0.0), atol=1e-5)
    np.testing.assert_allclose(told[-1][1], np.append(way.beyond, 0), atol=1e-5)
    assert all(abs(wrap_angle(t[2] - way.heading)) < 1e-6 for t in told)
    if not way.push:
        np.testing.assert_allclose(told[1][1], np.append(way.back, 0), atol=1e-5)


def test_hand_that_never_comes_ends_it_unreached():
    actor = drive(
        [goal(door()), Goal("idle", "", np.zeros(3), 0.0, 0.1)],
        solids=WALL,
        root=NORTH,
        grips=False,
        time_limit=4.0,
    )
    opened, idle = actor.director.results
    assert not opened.reached and idle.reached and np.ptp(actor.track("Door"), axis=0).max() == 0
    assert np.isnan(opened.hand_error_cm)


def test_open_door_is_walked_through():
    leaf = door()
    leaf.pose[3] = WIDE_OPEN
    actor = drive([goal(leaf)], solids=WALL, root=NORTH)
    assert actor.director.results[0].reached and np.ptp(actor.track("Door"), axis=0).max() < 1e-9
    actions = np.array([f["series"][2][6] for f in actor.frames[1:]])
    assert not actions[:, GOAL_ACTIONS.index("open")].any()


def test_a_leaf_let_go_early_stays_and_is_taken_anew():
    actor = Actor([goal(door())], solids=WALL, root=NORTH)
    while "held" not in states(actor) and actor.step():
        pass
    first = actor.director.grasps[-1]
    first.let_go()
    actor.run()
    assert actor.director.results[0].reached and actor.track("Door")[-1, 3] > np.radians(74)
    angle, led = actor.track("Door")[:, 3], states(actor)
    again = len(led) - 1 - led[::-1].index("reach")
    assert again > led.index("held") and angle[again] < np.radians(10), "it waits for the hand"


def still(wrist: np.ndarray, hand: int) -> SeenBody:
    local = np.zeros((J, 4))
    local[:, 0] = 1
    wrists = np.full((2, 3), 9.0)
    wrists[hand] = wrist
    return SeenBody(np.array((wrist[0] - 0.2, wrist[1] + 0.3, 0.9)), local, wrists)


def opening(leaf: Leaf, start, solids=WALL) -> Opening:
    return Opening(leaf, passage(leaf, np.array(start[:2])), solids, ik=False)


def test_body_that_pushes_opens_the_leaf_further():
    leaf = door(-1.0)  # swings away from who comes from the north
    work = opening(leaf, NORTH)
    assert work.way.push
    for _ in range(15):
        work.apply(still(work.grip(), work.way.hand), np.array(NORTH), np.ones(5))
    assert work.state == "held"
    root = np.array((0.45, -1.7, 0.0))
    for _ in range(90):
        root[1] -= 0.012
        work.apply(still(work.grip(), work.way.hand), root, np.ones(5))
        along = np.array((np.cos(leaf.pose[3]), np.sin(leaf.pose[3])))
        gap = root[:2] - leaf.pose[:2]
        apart = np.linalg.norm(gap - np.clip(gap @ along, 0, WIDTH) * along)
        assert apart > 0.17, "the leaf gives way in time"
    assert leaf.angle > 0.8


@pytest.mark.parametrize("ik", [True, False])
def test_nothing_pulls_a_leaf_open_but_hands_unless_contacts_are_corrected(ik):
    """Whose hand stays at the shut handle while the body stands back as one who pulls does."""
    leaf = door(1.0)
    work = Opening(leaf, passage(leaf, np.array(NORTH[:2])), WALL, ik)
    assert not work.way.push
    hand, at = work.way.hand, leaf.grip(work.way.side)
    for _ in range(60):
        work.apply(still(at, hand), np.append(work.way.back, 0.0), np.ones(5))
    assert work.state == "held" and (leaf.angle > 0.15 if ik else leaf.angle < 0.05)


def test_leaf_that_coasts_stops_at_a_body_in_its_way_and_stays_there():
    leaf = door(1.0)  # swings to the north
    work = opening(leaf, NORTH)
    for _ in range(60):
        ahead = leaf.grip(work.way.side, leaf.angle + (0.25 if work.state == "held" else 0.0))
        work.apply(still(ahead, work.way.hand), np.array(NORTH), np.ones(5))
        if leaf.angle > 0.3:
            break
    assert work.state == "held"
    work.let_go()
    body = np.array((0.3, -1.4, 0.0))  # in the quarter that the leaf sweeps
    for _ in range(150):
        work.apply(still(np.full(3, 9.0), work.way.hand), body, np.zeros(5))
    stopped = leaf.angle
    assert 0.3 < stopped < 1.0
    for _ in range(150):
        work.apply(still(np.full(3, 9.0), work.way.hand), np.array((0.4, -3.2, 0.0)), np.zeros(5))
    assert leaf.angle == stopped and not work.active


def test_leaf_stops_at_what_stands_behind_it():
    cupboard = Cuboids([((1.0, -1.2), 0.0, np.array([(-0.4, -0.3, 0.0)]), np.array([(0.4, 0.3, 1.8)]))])
    assert opening(door(), NORTH).widest > WIDE_OPEN > opening(door(), NORTH, cupboard).widest


@pytest.mark.parametrize("swing", [1.0, -1.0])
def test_a_leaf_without_room_to_open_is_told(swing):
    require_room(door(swing), WALL)
    buried = Cuboids([((0, -2), 0.0, np.array([(-2, -0.06, 0)]), np.array([(3, 0.06, 2.4)]))])
    crate = Cuboids(
        [((0.5, -2.0 + swing * 0.35), 0.0, np.array([(-0.2, -0.2, 0.0)]), np.array([(0.2, 0.2, 1.0)]))]
    )
    for solids in (buried, crate):
        with pytest.raises(GoalError, match="Door opens by only .* degrees before"):
            require_room(door(swing), solids)
    wide = door(swing)
    wide.pose[3] = swing * 1.4
    require_room(wide, buried)
