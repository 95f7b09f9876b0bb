"""Fronts of furniture: a drawer is opened to take a jar out of it and shut again, a door is opened, and what
no hand opens is told.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import all_depths, wrists
from nsm_core.model.inference.model import load_model
from nsm_core.world.affordances.picking import Around
from nsm_core.world.affordances.pulling import plan_pulling
from nsm_core.world.geometry.distance import Cuboids, Union
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.containers.cupboards import make_container
from nsm_core.world.scene.small_things import make_thing
from nsm_core.world.scene.wrist import TO_HELD

TABLE = Cuboids([((0, 0), 0.0, ((1.4, -1.9, 0.72),), ((2.4, -1.2, 0.75),))])
PLACE = np.array((1.6, -1.5, 0.75))
FREE = Around(Cuboids(), Cuboids(), lambda places: np.full(len(places), np.inf))


def container(kind, pose=(0.0, 0.0, 0.0, 0.0), **measures):
    return make_container(kind, np.random.default_rng(4), **measures).put(pose)


def played(goals, solids, start=(0.3, -2.2)):
    runner = TakeRunner(load_model(backend="numpy"), TakeRequest(np.array(start), 0.5, goals, solids, seed=1))
    while runner.frames < 1500 and runner.step():
        pass
    return runner.result()


def opens(front, **more):
    middle = front.to_world(front.volume.centre)
    return Goal("open", front.name, np.append(middle[:2], 0.0), 0.0, 0.0, prop=front, **more)


def at_handle(take, front, poses):
    """Metres (T,) by which the nearer hand, which may swivel about it, is off the handle, and the frames in
    which that moves.
    """
    moving = np.flatnonzero(np.abs(np.diff(poses, axis=0)).max(1) > 1e-6) + 1
    hands = wrists(take.hips_position, take.local_rotations)[moving]
    held = []
    for pose in poses[moving]:
        there = front.at(0.0)
        there.pose = pose
        held.append(front.grip(there.opening).held)
    off = np.linalg.norm(hands - np.array(held)[:, None], axis=-1) - TO_HELD
    return np.abs(off).min(1), moving


@pytest.fixture(scope="module")
def drawer():
    """A take in which a jar comes out of a drawer, which is opened before and shut after it."""
    piece = container("drawers", width=0.5, height=0.86)
    part, board = piece.parts[-1], piece.boards[-1]
    front = Front.of(part)
    foot = piece.to_world((*((board.low + board.high) / 2), board.height))
    jar = make_thing("jar", np.random.default_rng(1), np.append(foot, 0.0))
    first, then = (opens(front),), (opens(front, opening=0.0),)
    goals = [Goal("place", "Jar", PLACE, 0.0, 0.2, prop=jar, first=first, then=then)]
    others = [p for p in piece.parts if p is not part]
    return front, jar, played(goals, Union([piece.standing(), TABLE, *others]))


def test_the_jar_comes_out_with_its_drawer_and_the_drawer_is_shut_again(drawer):
    front, jar, take = drawer
    assert all(goal.reached for goal in take.goals)
    poses, jars = take.props[front.name], take.props["jar"]
    along = (poses[:, :3] - poses[0, :3]) @ front.part.axis / front.part.travel
    assert along.max() > 0.9 and along[-1] == pytest.approx(0.0, abs=1e-6)
    opened = int(along.argmax())
    np.testing.assert_allclose(jars[opened, :3] - jars[0, :3], poses[opened, :3] - poses[0, :3], atol=1e-9)
    np.testing.assert_allclose(jars[-1, :3], PLACE, atol=1e-6)
    (goal,) = take.goals
    assert goal.remarks == [f"{front.name} was shut again."]
    assert goal.hand_error_cm < 1.0  # of the hand at the jar, not of the one that shuts the drawer last
    put = int(np.flatnonzero(np.abs(np.diff(jars, axis=0)).max(1) > 1e-6)[-1])
    assert (
        np.abs(np.diff(along[: put + 1])).max() > 0 and along[put] > 0.9
    )  # and is shut after it is put down


def test_the_hand_is_at_the_handle_while_the_drawer_moves_and_it_moves_smoothly(drawer):
    front, _, take = drawer
    off, moving = at_handle(take, front, take.props[front.name])
    assert off.max() < 0.02
    steps = np.linalg.norm(np.diff(take.props[front.name][:, :3], axis=0), axis=1) * 30
    assert 0.2 < steps.max() < 0.51 and len(moving) > 30


def test_a_cupboards_door_swings_past_the_body():
    piece = container("wall cupboard", (0.0, 0.0, 1.42, 0.0), width=0.5, height=0.6, least=0.25)
    front = Front.of(piece.parts[0])
    take = played([opens(front)], piece.standing())
    (goal,), poses = take.goals, take.props[front.name]
    assert goal.reached and goal.hand_error_cm < 1.0
    turned = np.degrees(abs(poses[-1, 3] - poses[0, 3]))
    assert turned > 75
    assert np.abs(np.diff(poses[:, 3])).max() * 30 < 1.01
    assert at_handle(take, front, poses)[0].max() < 0.02
    solids = piece.standing()
    props = {front.name: front}
    assert all_depths(take.hips_position, take.local_rotations, solids, props, take.props).max() < 0.03


def test_a_front_moves_as_its_part_does():
    for kind, pose in (("drawers", (1, 2, 0, 0.7)), ("wall cupboard", (0.3, -1, 1.4, -2.0))):
        part = container(kind, pose).parts[0]
        front, points = Front.of(part), np.random.default_rng(0).normal(size=(5, 3))
        for share in (0.0, 0.4, 1.0):
            there = front.at(share)
            assert there.opening == pytest.approx(share, abs=1e-9)
            np.testing.assert_allclose(there.to_world(points), part.to_world(points, opening=share))


def refused(front, opening=1.0, around=FREE):
    with pytest.raises(GoalError) as told:
        plan_pulling(front, opening, around)
    return str(told.value)


def test_what_no_hand_opens_is_told_in_a_sentence():
    low = Front.of(container("drawers", height=0.86).parts[0])
    assert "over the floor, and one hand opens what it reaches between 0.4 and 1.9 m" in refused(low)
    with pytest.raises(GoalError, match="opens upwards or downwards, as a lid or a flap does"):
        Front.of(container("oven").parts[0])
    front = Front.of(container("drawers", height=0.86).parts[-1])
    wall = Cuboids([((0, 0), 0.0, ((-1, -0.55, 0.0),), ((1, -0.45, 2.0),))])
    assert "moves by only" in (told := refused(front, around=Around(wall, wall, FREE.room)))
    assert "make room for it to open" in told
    nowhere = Around(Cuboids(), Cuboids(), lambda places: np.full(len(places), -1.0))
    assert "no free floor from which one hand moves drawer 1" in refused(front, around=nowhere)
