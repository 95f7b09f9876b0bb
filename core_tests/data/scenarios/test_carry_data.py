"""Carrying in composed data: boxes rest, are held at their grasps and stand where they were asked for."""

from __future__ import annotations

from dataclasses import replace

import captures
import numpy as np
import pytest

from nsm_core.body.inertialization import BLEND_FRAMES
from nsm_core.body.skeleton import ARMS, FEET, forward_kinematics
from nsm_core.conventions import CARRY, HAND_CONTACTS
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.scenarios.carry import episode as carry_episode
from nsm_core.data.scenarios.carry.fit import bend_into_reach
from nsm_core.data.scenarios.carry.supports import Support
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.data.scenarios.hands import COMFORT, lead, place_hands
from nsm_core.data.scenarios.registry import SCENARIOS
from nsm_core.data.scenarios.scenario import episode
from nsm_core.data.scenarios.session import Session
from nsm_core.evaluation.measures.motion import backward_bend, jumps
from nsm_core.rotations import heading_to_direction, rotate_planar, wrap_angle
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import carried_box, cuboids

pytestmark = pytest.mark.slow  # goldens compare what is composed of every action under any numpy

WRISTS, SHOULDERS = [arm[2] for arm in ARMS], [arm[0] for arm in ARMS]


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    folder = captures.write_captures(tmp_path_factory.mktemp("pick_ups"))
    captures.write_pick_up(folder)
    return load(str(folder))


@pytest.fixture(scope="module")
def carried(source):
    """Takes that carry, each with its episodes."""
    found, laid = [], []
    kept = SCENARIOS["carry"]
    noted = episode(lambda session: laid.append(carry_episode.lay(session)) or laid[-1])
    SCENARIOS["carry"] = replace(kept, lay=noted)
    try:
        composer = Composer(source, {"carry": 1.0})
        for seed in range(40):
            laid.clear()
            take = composer.compose(seed)
            if take is not None and take.things:
                # What was laid and taken back again has no thing.
                found.append((take, [e for e in laid if e is not None and e.thing >= 0]))
            if sum(len(episodes) for _, episodes in found) > 5:
                return found
    finally:
        SCENARIOS["carry"] = kept
    raise AssertionError("40 seeds composed too few carries")


def each(carried):
    for take, episodes in carried:
        assert len(episodes) == len(take.things)
        for e in episodes:
            yield take, e, take.things[e.thing]


def test_wrists_are_at_the_grasps_while_they_hold(carried):
    for take, e, thing in each(carried):
        positions, _ = forward_kinematics(take.hips, take.rotations)
        held = np.flatnonzero(thing.held)
        assert len(held) > 20
        np.testing.assert_array_equal(take.contacts[held][:, HAND_CONTACTS], 1)
        for f in held:
            grasps = rotate_planar(e.box.learned_grasps(e.face), thing.poses[f, 3]) + thing.poses[f, :3]
            assert np.linalg.norm(positions[f, WRISTS] - grasps, axis=-1).max() < 0.005


def test_boxes_rest_before_and_after_where_commands_say(carried):
    for take, e, thing in each(carried):
        held = np.flatnonzero(thing.held)
        for frames, spot in ((slice(0, held[0] + 1), e.taken), (slice(held[-1], None), e.put)):
            np.testing.assert_allclose(
                thing.poses[frames, :3],
                np.broadcast_to(spot.centre, thing.poses[frames, :3].shape),
                atol=2e-3,
            )
            assert np.abs(wrap_angle(thing.poses[frames, 3] + e.face - spot.facing)).max() < 0.01
            under = 0.0 if spot.support is None else spot.support.top
            np.testing.assert_allclose(spot.centre[2], under + e.box.size[2] / 2, atol=1e-6)
        assert np.abs(np.diff(thing.poses, axis=0))[:, :3].max() < 0.2
        asked = [c for c in take.commands if c.thing == e.thing]
        assert asked[0].action == "carry" and asked[0].frame < e.taken.bend.start
        np.testing.assert_allclose(asked[0].position, e.taken.centre, atol=1e-4)
        assert asked[-1].action == "idle+carry" and held[0] < asked[-1].frame < e.put.bend.touch
        np.testing.assert_allclose(asked[-1].position, e.put.centre, atol=1e-4)
        assert all(c.action == "walk+carry" and c.position is None for c in asked[1:-1])


def test_a_box_is_never_inside_what_it_stands_on(carried):
    for _, e, thing in each(carried):
        lo, hi = thing.furniture.mins.min(0) + 0.004, thing.furniture.maxs.max(0) - 0.004
        np.testing.assert_allclose(lo, -hi, atol=1e-5)
        grid = np.stack(np.meshgrid(*np.linspace(lo, hi, 3).T), axis=-1).reshape(-1, 3)
        assert (thing.poses[:, 2] + lo[2]).min() > 0
        supports = [
            (s.support.piece, s.position, s.heading) for s in (e.taken, e.put) if s.support is not None
        ]
        if supports:
            moved = np.concatenate([rotate_planar(grid, pose[3]) + pose[:3] for pose in thing.poses[::2]])
            assert cuboids(supports).signed_distance(moved.astype(np.float32), 0.3).min() > -0.002


def test_bodies_bend_as_bodies_do(carried):
    for take, e, _ in each(carried):
        span = slice(max(e.taken.bend.start - 10, 0), e.put.bend.end + 20)
        bent = backward_bend(take.hips[span], take.rotations[span])
        assert bent["knee_backward_deg"] < 1 and bent["elbow_backward_deg"] < 8
        arms = take.rotations.copy()
        legs = [j for leg in FEET for j in leg]
        arms[:, legs] = (1, 0, 0, 0)  # walks have their own tests
        assert jumps(take.hips[span], arms[span])["turn_per_frame_deg"] < 30
        for bend in (e.taken.bend, e.put.bend):
            landed = bend.start + BLEND_FRAMES + 1  # the last step may end amid the first of the bend
            feet = forward_kinematics(take.hips, take.rotations)[0][
                landed : bend.end - 8, [leg[3] for leg in FEET], :2
            ]
            assert np.ptp(feet, axis=0).max() < 0.02
        assert take.labels[e.taken.bend.touch : e.put.bend.touch, CARRY].min() > 0.99
        assert take.labels[e.taken.bend.start - 1, CARRY] == 0 or e.thing > 0


def test_without_pick_ups_nothing_is_carried(tmp_path_factory):
    folder = captures.capture_folder(tmp_path_factory)
    assert carry_episode.segments(CaptureFolder(folder)) == []
    assert carry_episode.lay(Session(captures.source(folder), np.random.default_rng(0))) is None


def test_wrists_go_from_where_they_are_to_their_grips_past_the_sides():
    wrists, grips = (
        np.array(((-0.2, 0.0, 0.8), (0.2, 0.0, 0.8))),
        np.array(((-0.28, -0.35, 0.5), (0.28, -0.35, 0.5))),
    )
    progress = np.linspace(0, 1, 21)
    way = lead(np.repeat(wrists[None], 21, 0), np.repeat(grips[None], 21, 0), progress, np.zeros(21))
    np.testing.assert_allclose(way[0], wrists, atol=1e-9)
    np.testing.assert_allclose(way[-1], grips, atol=1e-9)
    box = way[:, 1, 1] < -0.15  # beside a box 0.5 wide, whose near face is at 0.15
    assert way[box, 1, 0].min() > 0.26 and way[box, 0, 0].max() < -0.26


def test_a_body_leans_into_reach_and_its_feet_stay():
    hips, local = captures.stand(60)
    grips = np.repeat(np.array(((-0.2, -0.35, 0.55), (0.2, -0.35, 0.55)))[None], 60, 0)
    progress = np.interp(np.arange(60), (10, 30), (0, 1))
    moved, leant = bend_into_reach(hips, local, grips, progress, np.zeros(60))
    before, after = forward_kinematics(hips, local)[0], forward_kinematics(moved, leant)[0]
    assert np.linalg.norm(before[40, SHOULDERS] - grips[40], axis=-1).max() > COMFORT
    ankles = [leg[2] for leg in FEET]
    np.testing.assert_allclose(after[:, ankles], before[:, ankles], atol=2e-3)
    held = forward_kinematics(moved, place_hands(moved, leant, grips, progress, np.zeros(60)))[0]
    np.testing.assert_allclose(held[32:, WRISTS], grips[32:], atol=5e-3)


@pytest.mark.parametrize("side", [0.0, np.pi / 2, np.pi, -np.pi / 2])
def test_supports_have_their_used_edge_before_the_box(side):
    table = furniture.make("table", np.random.default_rng(1), width=1.2, depth=0.8, height=0.7)
    reach = 0.4 if abs(np.cos(side)) > 0.5 else 0.6
    support = Support(table, 0.7, side, reach, 0.1, 0.02)
    facing, depth, centre = 0.7, 0.3, np.array((2.0, 1.0))
    position, heading = support.place(centre, facing, depth)
    lo, hi = support.footprint
    corners = (
        rotate_planar(np.array([(x, y) for x in (lo[0], hi[0]) for y in (lo[1], hi[1])]), np.float64(heading))
        + position
    )
    ahead = (corners - centre) @ heading_to_direction(np.array(facing))
    np.testing.assert_allclose(ahead.min(), -depth / 2 - 0.02, atol=1e-6)
    assert carried_box(table).size[2] == pytest.approx(0.7)
