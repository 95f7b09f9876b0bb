"""Takes with other objects in them: hips on the new seats, feet on the new steps, hands on the new boxes,
goals with them.
"""

from functools import cache

import captures
import numpy as np
import pytest

from nsm_core.body.skeleton import ARMS, FEET, HIP_OVER_SEAT, forward_kinematics
from nsm_core.body.thin_capsules import thin_depths
from nsm_core.conventions import CLIMB, FOOT_CONTACTS, HIP_CONTACT, SIT
from nsm_core.data.augmentation.soundness import DEEPER
from nsm_core.data.augmentation.swap_objects import switched
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.distances import SEATS_SWAPPED
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import carried_box, cuboids

TOES = [leg[3] for leg in FEET]


@cache
def _pairs(folder, action):
    """Takes of one action and what became of them, three that could be switched."""
    composer, found = Composer(captures.source(folder), {action: 1.0}), []
    for seed in range(30):
        take = composer.compose(seed)
        other = None if take is None else switched(take, None, seed)
        if other is not None:
            found.append((seed, take, other))
        if len(found) == 3:
            return found
    raise AssertionError(f"of 30 seeds only {len(found)} could be switched")


@pytest.fixture(scope="module", params=["sit", "climb"])
def pairs(request, tmp_path_factory):
    return _pairs(captures.capture_folder(tmp_path_factory), request.param)


@pytest.fixture(scope="module")
def sits(tmp_path_factory):
    return _pairs(captures.capture_folder(tmp_path_factory), "sit")


@pytest.fixture(scope="module")
def climbs(tmp_path_factory):
    return _pairs(captures.capture_folder(tmp_path_factory), "climb")


def changed(take, other):
    """Commands whose things were replaced: (before, after, old thing, new thing)."""
    both = zip(take.commands, other.commands, strict=True)
    all_ = [(a, b, take.things[a.thing], other.things[b.thing]) for a, b in both if a.thing >= 0]
    return [(a, b, old, new) for a, b, old, new in all_ if old is not new]


def solid(thing):
    return cuboids([(thing.furniture, thing.poses[:3], float(thing.poses[3]))])


def test_things_are_replaced_by_others_of_their_kind_and_the_rest_holds(pairs):
    for _, take, other in pairs:
        assert changed(take, other) and len(take) == len(other)
        for a, b, old, new in changed(take, other):
            assert new.furniture.kind == old.furniture.kind and not np.array_equal(
                new.furniture.size, old.furniture.size
            )
            assert (a.frame, a.action, a.heading, a.thing) == (b.frame, b.action, b.heading, b.thing)
        assert (
            other.labels is take.labels
            and other.contacts is take.contacts
            and other.phase_keys == take.phase_keys
        )


def test_the_same_seed_switches_alike_and_leaves_the_take_alone(pairs):
    seed, take, other = pairs[0]
    hips = take.hips.copy()
    again = switched(take, None, seed)
    np.testing.assert_array_equal(again.hips, other.hips)
    np.testing.assert_array_equal(again.rotations, other.rotations)
    np.testing.assert_array_equal(take.hips, hips)
    sizes = {
        tuple(n.furniture.size)
        for s in range(4)
        if (t := switched(take, None, s))
        for *_, n in changed(take, t)
    }
    assert len(sizes) > 1


def test_hips_rest_on_the_new_seat_and_the_goal_is_there(sits):
    heights = []
    for _, take, other in sits:
        for a, b, old, new in changed(take, other):
            seat = new.furniture.seat
            assert SEATS_SWAPPED[0] <= seat.height <= SEATS_SWAPPED[1]
            heights.append(seat.height - old.furniture.seat.height)
            on = (other.contacts[:, HIP_CONTACT] > 0.5) & (
                np.linalg.norm(take.hips - a.position, axis=1) < 0.1
            )
            assert on.sum() > 20
            np.testing.assert_allclose(other.hips[on].mean(0), b.position, atol=0.02)
            assert b.position[2] == pytest.approx(seat.height + HIP_OVER_SEAT, abs=0.02)
            place = new.position + rotate_planar(seat.point[:2].astype(float), np.float64(new.heading))
            assert np.linalg.norm(place - b.position[:2]) < 0.08
            assert wrap_angle(new.heading + seat.heading - b.heading) == pytest.approx(0, abs=0.1)
    assert np.ptp(heights) > 0.02


def test_feet_stand_where_they_stood_and_nothing_changes_far_from_the_seat(sits):
    for _, take, other in sits:
        before, after = (forward_kinematics(t.hips, t.rotations)[0] for t in (take, other))
        stands = take.contacts[:, FOOT_CONTACTS] > 0.5
        assert np.linalg.norm(after - before, axis=-1)[:, TOES][stands].max() < 0.015
        near = np.convolve(take.labels[:, SIT] > 0, np.ones(81), mode="same") > 0
        np.testing.assert_allclose(after[~near], before[~near], atol=1e-4)
        assert np.abs(after - before)[near].max() > 0.01


def test_goals_of_climbs_lie_on_the_new_tops_and_feet_stand_there(climbs):
    moved = 0
    for _, take, other in climbs:
        after = forward_kinematics(other.hips, other.rotations)[0][:, TOES]
        before = forward_kinematics(take.hips, take.rotations)[0][:, TOES]
        stands = take.contacts[:, FOOT_CONTACTS] > 0.5
        for a, b, old, new in changed(take, other):
            h, g = old.furniture.size[2], new.furniture.size[2]
            assert b.position[2] == pytest.approx(g if a.position[2] > 0 else 0)
            if not a.position[2]:
                continue
            local = rotate_planar(before[..., :2] - old.position, np.full(before.shape[:2], -old.heading))
            on_top = stands & (np.abs(local) < old.furniture.size[:2] / 2).all(-1) & (before[..., 2] > h)
            assert on_top.any()
            np.testing.assert_allclose(after[on_top][:, 2] - g, before[on_top][:, 2] - h, atol=0.02)
            moved += abs(g - h) > 0.01
        assert (take.labels[:, CLIMB] > 0).any()
    assert moved


def test_the_body_gets_hardly_deeper_into_things_than_before(pairs):
    for _, take, other in pairs:
        for *_, old, new in changed(take, other):
            before, after = (
                thin_depths(t.hips, t.rotations, solid(x)).max() for t, x in ((take, old), (other, new))
            )
            assert after <= before + DEEPER + 0.01  # it looks at every second frame
        rest = cuboids([(o.furniture, o.position, o.heading) for o in take.obstacles])
        before, after = (
            thin_depths(t.hips, t.rotations, rest).max() if take.obstacles else 0 for t in (take, other)
        )
        assert after <= before + DEEPER + 0.01


def test_hands_hold_the_new_box_which_rests_where_the_old_one_did(tmp_path_factory):
    folder = captures.write_captures(tmp_path_factory.mktemp("pick_ups"))
    captures.write_pick_up(folder)
    composer, seen = Composer(load(str(folder)), {"carry": 1.0}), 0
    for seed in range(30):
        take = composer.compose(seed)
        other = None if take is None else switched(take, None, seed)
        for a, b, old, new in [] if other is None else changed(take, other):
            if a.action != "carry":
                continue
            seen += 1
            (h, g) = (float(t.furniture.size[2]) for t in (old, new))
            np.testing.assert_allclose(new.poses[:, 2] - g / 2, old.poses[:, 2] - h / 2, atol=1e-5)
            np.testing.assert_allclose(b.position, new.poses[0, :3], atol=1e-4)
            puts = [
                c
                for c in other.commands
                if c.action == "idle+carry" and c.thing == b.thing and c.position is not None
            ]
            np.testing.assert_allclose(puts[-1].position, new.poses[-1, :3], atol=1e-4)
            face = np.round((b.heading - new.poses[0, 3]) / (np.pi / 2)) * np.pi / 2
            wrists = forward_kinematics(other.hips, other.rotations)[0][:, [arm[2] for arm in ARMS]]
            own = rotate_planar(wrists - new.poses[:, None, :3], np.repeat(-new.poses[:, None, 3], 2, axis=1))
            reach = np.linalg.norm(own - carried_box(new.furniture).learned_grasps(face), axis=-1)
            assert reach[new.held].max() < 0.03 and np.median(reach[new.held]) < 0.005
            assert not np.allclose(new.furniture.size, old.furniture.size, atol=0.005)
        if seen >= 2:
            return
    raise AssertionError(f"of 30 seeds only {seen} boxes could be switched")


def test_takes_without_sits_and_climbs_are_not_switched(tmp_path_factory):
    source = captures.source(captures.capture_folder(tmp_path_factory))
    takes = [t for seed in range(6) if (t := Composer(source, {"walk": 1.0}).compose(seed))]
    assert takes and all(switched(t, Pool(), 0) is None for t in takes)
