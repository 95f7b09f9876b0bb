"""Kitchens by seed: the same every time, things free of contact on their boards, doors that open."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GeometryError
from nsm_core.evaluation.kitchens import fields_of, least_gap, take_thing
from nsm_core.world.assets.kitchen import make_kitchen
from nsm_core.world.planning.hand_fields import hand_fields


@pytest.fixture(scope="module")
def kitchens():
    return [make_kitchen(seed) for seed in range(4)]


def test_a_seed_gives_one_kitchen_and_another_gives_another(kitchens):
    again = make_kitchen(2)
    assert list(again.things) == list(kitchens[2].things)
    for name, standing in again.things.items():
        np.testing.assert_array_equal(standing.thing.pose, kitchens[2].things[name].thing.pose)
    assert list(again.things) != list(kitchens[3].things)


def test_a_kitchen_has_all_that_one_has(kitchens):
    for kitchen in kitchens:
        kinds = {c.kind for c in kitchen.containers.values()}
        assert {"floor cupboard", "wall cupboard", "drawers", "fridge", "sink cupboard", "oven", "rack",
                "worktop", "table"} <= kinds  # fmt: skip
        assert len(kitchen.things) > 25
    opens = {p.kind for k in kitchens for c in k.containers.values() for p in c.parts}
    assert opens == {"hinged", "drawer", "sliding", "lid"}
    assert len({s.thing.kind for k in kitchens for s in k.things.values()}) == 20
    heights = [s.thing.pose[2] for k in kitchens for s in k.things.values()]
    assert min(heights) < 0.25 and max(heights) > 1.6


def test_things_stand_on_boards_and_touch_nothing_else(kitchens):
    for kitchen in kitchens:
        assert least_gap(kitchen) > 0.005
        scene = kitchen.scene()
        for name, standing in kitchen.things.items():
            thing = standing.thing
            container, board = kitchen.board_of(name)
            assert thing.pose[2] == pytest.approx(container.pose[2] + board.height)
            foot = np.append(thing.pose[:2], thing.pose[2] + 0.001)[None].astype(np.float32)
            beneath = scene.near(thing.pose[:2], 0.3, thing).signed_distance(foot, 0.1)[0]
            assert beneath == pytest.approx(0.001, abs=1e-4), (kitchen.seed, name)


def test_fronts_open_clear_of_walls_carcasses_and_other_fronts(kitchens):
    share = np.random.default_rng(0).uniform(-0.98, 0.98, (24, 1, 3))
    for kitchen in kitchens:
        scene = kitchen.scene()
        fronts = [p for c in kitchen.containers.values() for p in c.parts]
        for part in fronts:
            boxes = part.query.groups[0]
            points = (boxes.centres + boxes.halves * share).reshape(-1, 3)
            for opening in (0.0, 0.5, 1.0):
                part.opening = opening
                world = part.to_world(points).astype(np.float32)
                assert scene.environment.signed_distance(world, 0.1).min() > -1e-4, (kitchen.seed, part.name)
                others = [p for p in fronts if p is not part]
                assert min(p.signed_distance(world, 0.1).min() for p in others) > -1e-4
            part.opening = 0.0


def test_what_lies_in_a_drawer_goes_with_it(kitchens):
    kitchen = kitchens[0]
    name = next(n for n, s in kitchen.things.items() if kitchen.board_of(n)[1].rides)
    standing = kitchen.things[name]
    (part,) = kitchen.shut_by(name)
    before = standing.thing.pose.copy()
    kitchen.open(standing.container, part, 1.0)
    moved = standing.thing.pose - before
    travel = kitchen.containers[standing.container].part(part).travel
    np.testing.assert_allclose(moved, (0, -travel, 0, 0), atol=1e-9)
    kitchen.open(standing.container, part, 0.0)
    np.testing.assert_allclose(standing.thing.pose, before, atol=1e-9)
    with pytest.raises(GeometryError, match="There is no cellar"):
        kitchen.open("cellar", "door", 1.0)


def test_blockers_stand_before_what_they_block(kitchens):
    pairs = [(k, s, k.things[b]) for k in kitchens for s in k.things.values() for b in s.blockers]
    assert len(pairs) > 6
    for _, behind, before in pairs:
        assert (behind.container, behind.board) == (before.container, before.board)
        assert before.thing.pose[1] < behind.thing.pose[1]
        assert abs(before.thing.pose[0] - behind.thing.pose[0]) < 0.2
    assert all(not s.blockers for s in make_kitchen(0, blocked=0.0).things.values())


def test_things_are_taken_from_where_they_are_and_all_is_shut_again(kitchens):
    kitchen = kitchens[1]
    free = next(n for n in kitchen.things if not kitchen.shut_by(n) and not kitchen.things[n].blockers)
    shut = next(n for n in kitchen.things if kitchen.shut_by(n))
    one, other = take_thing(kitchen, free), take_thing(kitchen, shut)
    assert one.condition == "open" and other.condition in ("shut", "blocked") and other.shut_by
    assert one.grasp is not None and one.reach is not None
    assert all(p.opening == 0 for c in kitchen.containers.values() for p in c.parts)
    _, reached = fields_of(kitchen, one)
    assert reached > 0.1


def test_no_front_marches_under_the_floor_or_through_the_wall(kitchens):
    kitchen = kitchens[0]
    name = next(n for n, s in kitchen.things.items() if s.container == "rack" and s.thing.pose[2] < 0.5)
    thing = kitchen.things[name].thing
    centre = thing.to_world((thing.low + thing.high) / 2)
    path = centre + np.array((0.0, -0.4, 0.1)) * np.linspace(1, 0.3, 20)[:, None]
    made = hand_fields(thing, kitchen.scene().near(thing.pose[:2], 0.75, thing), centre, path)
    under, behind = made.points[..., 2] < -0.02, made.points[..., 1] > 0.12
    assert under.any() and behind.any()
    for field in (made.target, made.arrival):
        assert (field[under] == 0).all() and (field[behind] == 0).all() and (field > 0).mean() > 0.1
