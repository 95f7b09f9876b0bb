"""Climbing: feet off the edges and on top at its height, the command and its label, and nothing of the body
in the block.
"""

from functools import cache

import captures
import numpy as np
import pytest

from nsm_core.body.skeleton import FEET, HIPS, forward_kinematics
from nsm_core.body.thin_capsules import thin_depths
from nsm_core.conventions import CLIMB, FOOT_CONTACTS
from nsm_core.data.scenarios.climb.clearance import leg_depths, splayed
from nsm_core.data.scenarios.climb.footholds import (
    HEEL,
    TIPS,
    Block,
    Foothold,
    draw_near,
    find_holds,
    set_off,
    shift_off_edges,
)
from nsm_core.data.scenarios.composer import Composer
from nsm_core.evaluation.measures.motion import backward_bend, jumps
from nsm_core.rotations import heading_to_direction
from nsm_core.world.scene.furniture import cuboids

pytestmark = pytest.mark.slow  # goldens compare what is composed of every action under any numpy

TOES = [leg[3] for leg in FEET]
BLOCK = Block(np.array((1.0, 2.0)), 0.0, np.array((0.5, 0.3)), 0.4)


@cache
def _climbs(folder):
    """Takes that climb, by whether it was over a wall: (take, command, first frame and one past the last)."""
    composer, found = Composer(captures.source(folder), {"climb": 1.0}), {True: [], False: []}
    for seed in range(14):
        take = composer.compose(seed)
        for n, c in enumerate([] if take is None else take.commands):
            if c.action == "idle+walk":
                # A climb lasts until the next one, or until the take's next thing to do on the floor.
                later = [d.frame for d in take.commands[n + 1 :] if d.thing >= 0]
                found[take.things[c.thing].furniture.kind == "low_wall"].append(
                    (take, c, c.frame, [*later, len(take)][0])
                )
        if min(map(len, found.values())) > 1:
            return found
    raise AssertionError(f"14 seeds climbed { {k: len(v) for k, v in found.items()} } times")


@pytest.fixture(scope="module")
def climbs(tmp_path_factory):
    return _climbs(captures.capture_folder(tmp_path_factory))


def _hold(x: float, y: float, heading: float = 0.0) -> Foothold:
    return Foothold(0, 0, 10, np.array((x, y)), heading)


def test_holds_are_the_stays_of_each_foot_in_the_order_of_landing():
    on = np.zeros((30, 2), bool)
    on[:8, 0] = on[20:, 0] = on[5:18, 1] = True
    toes = np.zeros((30, 2, 3))
    toes[20:, 0, 1] = -0.6
    toes[:, 1, 1] = -0.3
    holds = find_holds(toes, np.zeros((30, 2)), on)
    assert [(h.side, h.first, h.last) for h in holds] == [(0, 0, 8), (1, 5, 18), (0, 20, 30)]
    np.testing.assert_allclose([h.place[1] for h in holds], (0, -0.3, -0.6))


def test_soles_are_moved_as_little_as_takes_them_off_the_edges():
    # Facing -Y: the heel is behind, towards +Y.  The near edge for one who comes from +Y is at y = 2.3.
    before, across, on_edge, inside = _hold(1.0, 2.6), _hold(1.0, 2.32), _hold(1.0, 2.2), _hold(1.0, 1.95)
    holds = [before, across, on_edge, inside]
    shifts = shift_off_edges(holds, np.array((False, False, True, True)), BLOCK)
    np.testing.assert_allclose(shifts[[0, 3]], 0, atol=1e-9)
    assert shifts[1, 1] > 0 and 2.32 + shifts[1, 1] - TIPS > 2.3
    assert shifts[2, 1] < 0 and 2.2 + shifts[2, 1] + HEEL < 2.3 + 0.031
    np.testing.assert_allclose(shifts[:, 0], 0, atol=1e-9)


def test_a_block_shorter_than_the_sole_is_stood_on_over_its_middle():
    short = Block(np.zeros(2), 0.0, np.array((0.5, 0.08)), 0.3)
    shift = shift_off_edges([_hold(0, 0.2)], np.array((True,)), short)[0]
    assert 0.2 + shift[1] == pytest.approx((TIPS - HEEL) / 2)


def test_feet_beside_a_wall_come_near_it_but_not_into_it():
    holds, shifts = [_hold(1.0, 2.6), _hold(1.0, 1.4)], np.zeros((2, 2))
    draw_near(holds, shifts, [0, 1], BLOCK)
    assert shifts[0, 1] < 0 < shifts[1, 1]
    assert 2.6 + shifts[0, 1] - TIPS > 2.3 and 1.4 + shifts[1, 1] + HEEL < 1.7


def test_a_foot_is_set_off_the_side_it_stands_before():
    shifts = np.zeros((2, 2))
    set_off([_hold(1.0, 2.42)], shifts, 0, BLOCK, 0.2)
    assert 2.42 + shifts[0, 1] - TIPS == pytest.approx(2.5)
    assert shifts[0, 0] == pytest.approx(0)
    set_off([_hold(1.0, 3.0), _hold(1.0, 3.0)], shifts, 1, BLOCK, 0.2)
    np.testing.assert_allclose(shifts[1], 0)


def _standing(at: tuple[float, float]):
    rotations = np.zeros((30, 23, 4))
    rotations[..., 0] = 1
    return np.tile((*at, 0.9), (30, 1)), rotations


def test_legs_are_as_deep_in_a_block_as_their_flesh():
    # Beside the block by a metre (0.8 m from the heels), and with the shins on its middle.
    for at, inside in (((1.0, 3.3), False), ((1.0, 2.0), True)):
        depths = leg_depths(*_standing(at), BLOCK)
        assert depths.shape == (30, 2)
        if inside:
            assert (depths > 0.2).all()
        else:
            np.testing.assert_allclose(depths, depths[0, 0], atol=0.03)
            assert -0.85 < depths.max() < -0.75


def test_splayed_knees_point_outward_while_the_feet_stay_where_they_are():
    hips, rotations = _standing((0.0, 0.0))
    rotations[:, FEET[0][0]] = rotations[:, FEET[1][0]] = (np.cos(0.4), -np.sin(0.4), 0, 0)
    rotations[:, FEET[0][1]] = rotations[:, FEET[1][1]] = (np.cos(0.6), np.sin(0.6), 0, 0)
    before, world = forward_kinematics(hips, rotations)
    gaps = [(side, 10, 20, np.zeros(3), np.zeros(3)) for side in (0, 1)]
    turned, _, angles = splayed(before, rotations, world, world[:, [leg[2] for leg in FEET]], gaps, 0.6)
    after, _ = forward_kinematics(hips, turned)
    ankles, knees = [leg[2] for leg in FEET], [leg[1] for leg in FEET]
    np.testing.assert_allclose(after[:, ankles], before[:, ankles], atol=1e-6)
    apart = after[:, knees[1], 0] - after[:, knees[0], 0]
    assert abs(apart[13]) > abs(apart[0]) + 0.05 and np.abs(angles[0]).max() == 0
    np.testing.assert_allclose(after[[0, 25]], before[[0, 25]], atol=1e-6)


def test_one_stands_on_top_of_a_step_where_the_command_asks(climbs):
    for take, command, first, _ in climbs[False]:
        thing = take.things[command.thing]
        height = float(thing.furniture.size[2])
        assert command.position[2] == pytest.approx(height, abs=1e-5)
        pos, _ = forward_kinematics(take.hips, take.rotations)
        at = np.linalg.norm(pos[first:, HIPS, :2] - command.position[:2], axis=1) < 0.02
        stands = first + np.flatnonzero(at & (pos[first:, HIPS, 2] > height + 0.8))
        assert len(stands) > 5
        on = take.contacts[stands][:, FOOT_CONTACTS] > 0
        assert on.any(1).all() and on.all(1).mean() > 0.5
        toes = pos[stands][:, TOES][on]
        np.testing.assert_allclose(toes[..., 2], height + 0.026, atol=0.012)
        block = Block(thing.position, thing.heading, thing.furniture.size[:2] / 2, height)
        assert block.holds(toes[..., :2].astype(float), 0.0).all()
        assert take.labels[stands, CLIMB].min() < 0.5


def test_one_ends_on_the_floor_behind_a_wall(climbs):
    for take, command, first, last in climbs[True]:
        thing = take.things[command.thing]
        pos, _ = forward_kinematics(take.hips, take.rotations)
        before, after = thing.position - pos[first, HIPS, :2], command.position[:2] - thing.position
        over = heading_to_direction(np.array(thing.heading + np.pi))
        assert command.position[2] == 0 and before @ over > 0.2 and after @ over > 0.15
        top = pos[first:last, TOES, 2].max(0)
        assert (top > thing.furniture.size[2]).all()


def test_the_label_is_up_while_a_foot_changes_level(climbs):
    for take, command, first, last in climbs[False]:
        height = float(take.things[command.thing].furniture.size[2])
        pos, _ = forward_kinematics(take.hips, take.rotations)
        standing = float(np.median(pos[:30, HIPS, 2]))
        between = np.abs(pos[first:last, HIPS, 2] - standing - height / 2) < 0.1 * height
        assert take.labels[first:last][between, CLIMB].mean() > 0.5
        ups = np.flatnonzero(np.diff((take.labels[first:last, CLIMB] > 0.5).astype(int)) == 1)
        assert len(ups) == 2  # up and down


def test_climbing_bodies_bend_as_bodies_do_and_keep_out_of_the_block(climbs):
    for take, command, first, last in climbs[False] + climbs[True]:
        thing, span = take.things[command.thing], slice(first, last)
        depth = thin_depths(
            take.hips[span], take.rotations[span], cuboids([(thing.furniture, thing.position, thing.heading)])
        )
        assert depth.max() < 0.045
        assert backward_bend(take.hips[span], take.rotations[span])["knee_backward_deg"] < 1
        assert jumps(take.hips[span], take.rotations[span])["turn_per_frame_deg"] < 60


def test_standing_feet_do_not_slide(climbs):
    for take, _, first, last in climbs[False] + climbs[True]:
        pos, _ = forward_kinematics(take.hips[first:last], take.rotations[first:last])
        on = take.contacts[first:last][:, FOOT_CONTACTS] > 0
        step = np.linalg.norm(np.diff(pos[:, TOES], axis=0), axis=-1)
        assert np.percentile(step[on[1:] & on[:-1]], 95) < 0.006
