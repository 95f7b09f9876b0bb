"""Grasps and reach: fingers on both sides of the thing, hands clear of it and of what is around."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GoalError
from nsm_core.world.affordances.grasps import find_grasps
from nsm_core.world.affordances.reach import LEFT, REACHED, RIGHT, reaches
from nsm_core.world.geometry.distance import Cuboids, Union
from nsm_core.world.scene.small_things import THINGS, make_thing
from nsm_core.world.scene.wrist import WIDEST_GRIP, wrist_at

NOTHING = Union([])
BOARD = Cuboids([((0, 0, 0), 0.0, [(-0.5, -0.5, 0.96)], [(0.5, 0.5, 1.0)])])


def grasps_of(thing, around=BOARD, **more):
    return find_grasps(
        thing.name, thing.query, thing.low, thing.high, thing.pose, around, thing.mass, thing.handle, **more
    )


@pytest.fixture(scope="module")
def held():
    rng = np.random.default_rng(0)
    things = [make_thing(kind, rng, (0.1, -0.1, 1.0, 0.6)) for kind in THINGS]
    return [(thing, grasps_of(thing)) for thing in things]


def test_every_kind_is_held_with_the_thing_between_the_fingers(held):
    for thing, found in held:
        assert found, thing.kind
        for grasp in found[:6]:
            wrist = grasp.at(thing.pose)
            np.testing.assert_allclose(wrist.rotation.T @ wrist.rotation, np.eye(3), atol=1e-9)
            side = wrist.rotation[:, 0]
            fingers = np.stack([wrist.held + s * (grasp.width / 2 + 0.009) * side for s in (-1, 1)])
            assert (thing.signed_distance(fingers.astype(np.float32), 1.0) > 0).all()
            line = wrist.held + np.linspace(-0.5, 0.5, 41)[:, None] * grasp.width * side
            assert (thing.signed_distance(line.astype(np.float32), 1.0) < 0.003).any()
            assert 0 < grasp.width <= WIDEST_GRIP + 1e-9 and grasp.room >= 0
            assert BOARD.signed_distance(wrist.place[None].astype(np.float32), 1.0)[0] > 0.03
        assert [g.score for g in found] == sorted((g.score for g in found), reverse=True)


def test_a_thing_is_held_as_people_hold_its_kind(held):
    kinds = {thing.kind: {g.kind for g in found} for thing, found in held}
    best = {thing.kind: found[0] for thing, found in held}
    assert "handle" in kinds["mug"] and "handle" in kinds["saucepan"] and best["kettle"].kind == "handle"
    assert best["bottle"].kind == "side" and "top" in kinds["bowl"] and kinds["plate stack"] == {"side"}
    assert best["bowl"].width < 0.04  # by its rim
    assert abs(best["bottle"].wrist.rotation[2, 2]) > 0.85  # thumb up


def test_what_is_around_takes_grasps_away():
    jar = make_thing("jar", np.random.default_rng(1))
    free = grasps_of(jar, NOTHING)
    walls = [((0, 0, 0), 0.0, [(-0.5, 0.06, -0.1)], [(0.5, 0.08, 0.5)]),
             ((0, 0, 0), 0.0, [(-0.5, -0.5, 0.2)], [(0.5, 0.5, 0.22)])]  # fmt: skip
    shelf = grasps_of(jar, Cuboids(walls))
    assert 0 < len(shelf) < len(free)
    assert all(g.kind == "side" and g.wrist.place[1] < 0.02 for g in shelf)
    front = ((0, 0, 0), 0.0, [(-0.3, -0.08, 0.0)], [(0.3, -0.06, 0.3)])
    box = Cuboids([*walls, front])
    assert len(grasps_of(jar, box)) < len(shelf)
    assert len(grasps_of(jar, NOTHING, least_room=0.05)) == len(free)


def test_what_is_too_large_or_heavy_is_told():
    loaf = make_thing("loaf", np.random.default_rng(0))
    with pytest.raises(GoalError, match="loaf weighs 4.0 kg"):
        find_grasps("loaf", loaf.query, loaf.low, loaf.high, loaf.pose, NOTHING, mass=4.0)
    with pytest.raises(GoalError, match="loaf is 40 cm long, too large for one hand"):
        find_grasps("loaf", loaf.query, loaf.low, loaf.low + 0.4, loaf.pose, NOTHING)


def test_a_standing_body_reaches_from_low_to_high_and_not_beyond():
    for height in (0.25, 0.6, 1.0, 1.5, 1.9):
        wrist = wrist_at(np.array((0.0, 0.0, height)), (0, 1, 0.35 * (height > 1.6)), (0, 0, 1))
        found = reaches(wrist, NOTHING)
        assert found, height
        assert found[0].place[1] < wrist.place[1] and 0.2 < np.hypot(*found[0].place - wrist.place[:2]) < 0.75
        assert (found[0].down > 0.3) == (height < 0.9)
        assert {r.side for r in found} == {RIGHT, LEFT}
        assert [r.strain for r in found] == sorted(r.strain for r in found)
    for height in (REACHED[0] - 0.05, REACHED[1] + 0.05):
        assert reaches(wrist_at(np.array((0.0, 0.0, height)), (0, 1, 0), (0, 0, 1)), NOTHING) == []


def test_a_body_stands_clear_of_what_is_in_its_way():
    wrist = wrist_at(np.array((0.0, 0.0, 1.0)), (0, 1, 0), (0, 0, 1))
    counter = Cuboids([((0, 0, 0), 0.0, [(-2, -0.3, 0)], [(2, 0.5, 0.9)])])
    found = reaches(wrist, counter)
    assert found and all(r.place[1] < -0.3 - 0.1 for r in found)
    over = wrist_at(np.array((0.0, 0.22, 1.05)), (0, 1, 0), (0, 0, 1))  # farther in: one leans over it
    leaning = reaches(over, counter)
    assert found[0].lean == 0 and leaning and leaning[0].lean > 0 and leaning[0].place[1] < -0.4
    deep = Cuboids([((0, 0, 0), 0.0, [(-2, -1.2, 0)], [(2, 2, 0.9)])])
    assert reaches(wrist, deep) == []
    assert {r.side for r in reaches(wrist, counter, (LEFT,))} == {LEFT}
