"""Doors in composed takes: hands that keep to handles, leaves clear of the body, walls that nobody walks
through.
"""

from __future__ import annotations

from pathlib import Path

import captures
import numpy as np
import pytest

from nsm_core.body.skeleton import ARMS, HIPS, forward_kinematics
from nsm_core.body.thin_capsules import thin_spheres
from nsm_core.conventions import HAND_CONTACTS, OPEN
from nsm_core.data.scenarios.composer import Composer
from nsm_core.data.scenarios.hands import ARM, lead_hand
from nsm_core.data.scenarios.open.draws import OPENS
from nsm_core.data.scenarios.open.episode import lean_to
from nsm_core.data.scenarios.open.leaf_motion import swing_on
from nsm_core.data.scenarios.take import ComposedTake, Thing, annotate, goal_tables
from nsm_core.evaluation.measures.motion import backward_bend
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.assets.pool import Pool
from nsm_core.world.assets.pool_cache import DoorEntry
from nsm_core.world.scene.furniture import cuboids

pytestmark = pytest.mark.slow  # goldens compare what is composed of every action under any numpy


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return captures.capture_folder(tmp_path_factory)


@pytest.fixture(scope="module")
def doors(folder) -> list[tuple[ComposedTake, Thing, bool]]:
    """Takes with a door that is passed, and whether it is pulled: at least one of either kind."""
    composer, found = Composer(captures.source(folder), {"open": 0.7, "walk": 0.3}), []
    for seed in range(40):
        take = composer.compose(seed)
        for number, thing in enumerate(take.things if take is not None else ()):
            found.append(
                (take, thing, any(c.action == "idle+open" and c.thing == number for c in take.commands))
            )
        if len({pulled for _, _, pulled in found}) == 2:
            return found
    raise AssertionError(f"40 seeds opened {len(found)} doors, not one of either kind")


def hand_of(take: ComposedTake, thing: Thing) -> int:
    first = int(np.flatnonzero(thing.held)[0])
    return int(np.argmax(take.contacts[first, HAND_CONTACTS]))


def to_leaf(points: np.ndarray, thing: Thing) -> np.ndarray:
    """World points (T, N, 3) in the leaf's own frame."""
    turned = np.repeat(thing.poses[:, None, 3], points.shape[1], axis=1)
    return rotate_planar(points.astype(float) - thing.poses[:, None, :3], -turned)


def in_frame(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """World places (N, 2) in the frame of a pose (4,)."""
    return rotate_planar(points.astype(float) - pose[:2], np.full(len(points), -pose[3]))


def depth(centres: np.ndarray, radii: np.ndarray, solid) -> np.ndarray:
    """How deep (T, S) spheres are inside solids, metres; negative outside."""
    return radii - solid.signed_distance(centres.reshape(-1, 3).astype(np.float32), 0.3).reshape(
        centres.shape[:2]
    )


def test_doors_have_the_measures_of_the_pools_meshes(folder):
    measures = {
        "width": 0.85,
        "height": 2.0,
        "panel": 0.062,
        "grips": 0.16,
        "handle_height": 0.82,
        "handle_edge": 0.07,
        "lever": 0.03,
        "depth": 0.12,
    }
    composer = Composer(
        captures.source(folder), {"open": 1}, Pool(doors=[DoorEntry("door", measures)], mesh_share=1.0)
    )
    leaves = [
        t.furniture for take in map(composer.compose, range(3)) if take is not None for t in take.things
    ]
    assert len(leaves) > 2
    for leaf in leaves:
        size = leaf.maxs[0] - leaf.mins[0]
        assert size[1] == pytest.approx(0.062, abs=1e-5) and 0.78 < size[0] < 0.92
        handle = (leaf.mins[1:, 2] + leaf.maxs[1:, 2]) / 2
        assert handle.min() > OPENS.handle_height[0] - 1e-5, "a hand cannot reach it upright"


def test_the_hand_keeps_to_the_handle_while_it_holds(doors):
    for take, thing, _ in doors:
        side = hand_of(take, thing)
        joints, _ = forward_kinematics(take.hips, take.rotations)
        wrist = to_leaf(joints[:, [ARMS[side][2]]], thing)[thing.held, 0]
        assert np.ptp(wrist, axis=0).max() < 0.012 and len(wrist) > 20
        levers = thing.furniture.mins[1:], thing.furniture.maxs[1:]
        assert (levers[0].min(0) - 0.04 < wrist).all() and (wrist < levers[1].max(0) + 0.04).all()
        assert (take.contacts[thing.held, HAND_CONTACTS[side]] == 1).all()
        held = np.flatnonzero(thing.held)
        about = slice(max(held[0] - 10, 0), held[-1] + 16)
        assert backward_bend(take.hips[about], take.rotations[about])["elbow_backward_deg"] < 3
        step = np.linalg.norm(np.diff(joints[about, ARMS[side][2]], axis=0), axis=1)
        assert step.max() < 0.12, "the hand jumps"


def test_the_leaf_rests_until_it_is_held_then_opens_wide(doors):
    for _, thing, _ in doors:
        angle = np.abs(wrap_angle(thing.poses[:, 3] - thing.poses[0, 3]))
        held = np.flatnonzero(thing.held)
        assert (angle[: held[0] + 2] < 1e-6).all() and (np.diff(angle) > -1e-6).all()
        assert np.radians(30) < angle[held[-1]] < np.radians(80) and np.radians(80) < angle[-1] < np.radians(
            110
        )
        assert np.abs(np.diff(angle)).max() < np.radians(8) and np.abs(
            np.diff(angle, n=2)
        ).max() < np.radians(2)


def test_the_body_touches_neither_leaf_nor_wall(doors):
    for take, thing, _ in doors:
        side = hand_of(take, thing)
        centres, radii = thin_spheres(take.hips, take.rotations)
        wrist = forward_kinematics(take.hips, take.rotations)[0][:, ARMS[side][2]]
        away = np.linalg.norm(centres - wrist[:, None], axis=-1) > 0.2
        leaf = cuboids([(thing.furniture, np.zeros(3), 0.0)])
        assert depth(to_leaf(centres, thing), radii, leaf)[away].max() < 0.021
        for wall in (o for o in take.obstacles if o.furniture.kind == "doorway"):
            assert (
                depth(centres, radii, cuboids([(wall.furniture, wall.position, wall.heading)])).max() < 0.05
            )


def test_commands_lead_to_the_handle_back_and_through(doors):
    for take, thing, pulled in doors:
        number = next(n for n, t in enumerate(take.things) if t is thing)
        mine = [c for c in take.commands if c.thing == number]
        assert [c.action for c in mine] == ["open", *(["idle+open"] if pulled else []), "walk+open"]
        held, root = np.flatnonzero(thing.held), annotate(take).root
        grip = forward_kinematics(take.hips, take.rotations)[0][held[0], ARMS[hand_of(take, thing)][2]]
        assert np.linalg.norm(mine[0].position - grip) < 0.012 and mine[0].frame < held[0]
        assert 2 <= mine[1].frame - held[0] <= 6
        local, after = (
            in_frame(root[:, :2], thing.poses[0]),
            in_frame(mine[-1].position[None, :2], thing.poses[0])[0, 1],
        )
        assert local[mine[0].frame, 1] * after < 0 and abs(after) > 0.5, "one ends on the far side"
        crossing = local[np.flatnonzero(np.diff(np.sign(local[:, 1]))), 0]
        wide = thing.furniture.maxs[0, 0]
        through = (0.15 < crossing) & (crossing < wide - 0.15)
        assert through.any() and (through | (crossing < -1) | (crossing > wide + 1)).all(), (
            "one walks through the wall"
        )
        _, _, action = goal_tables(take, annotate(take))
        now = action[min(mine[-1].frame + 5, len(take) - 1), 6]
        assert now.tolist() == [0, 1, 0, 0, 1, 0]
        if pulled:
            angle = np.abs(wrap_angle(thing.poses[mine[-1].frame, 3] - thing.poses[0, 3]))
            assert (
                angle > np.radians(70)
                and np.linalg.norm(root[mine[-1].frame, :2] - mine[1].position[:2]) < 0.15
            )


def test_labels_rise_to_the_grip_and_fall_after_it(doors):
    for take, thing, _ in doors:
        held = np.flatnonzero(thing.held)
        label = take.labels[:, OPEN]
        assert (label[held] > 0.9).all() and label[max(held[0] - 30, 0)] == 0
        after = label[held[-1] + 1 : held[-1] + 20]
        assert len(after) == 0 or after[-1] < 0.2


def test_the_trunk_leans_as_far_as_the_arm_is_short(doors):
    take, thing, _ = doors[0]
    f = int(np.flatnonzero(thing.held)[0]) - 30
    hips, rotations = (x[f : f + 1].astype(float).repeat(12, axis=0) for x in (take.hips, take.rotations))
    joints, _ = forward_kinematics(hips, rotations)
    ahead = rotate_planar(np.array((0.0, -1.0, 0.0)), np.float64(annotate(take).root[f, 2]))
    shoulder = joints[0, ARMS[0][0]]
    weight = np.ones(12)
    for reach, moves in ((0.45, False), (0.6, True)):
        target = np.repeat((shoulder + ahead * np.sqrt(reach**2 - 0.09) - (0, 0, 0.3))[None], 12, axis=0)
        leant = lean_to(hips, rotations, 0, target, weight)
        after, _ = forward_kinematics(hips, leant)
        assert (np.abs(leant - rotations).max() > 0.02) == moves
        assert np.linalg.norm(after[:, ARMS[0][0]] - target, axis=1).max() < ARM + 0.01
        np.testing.assert_allclose(after[:, HIPS], joints[:, HIPS], atol=1e-9)
        normal = np.repeat(-ahead[None], 12, axis=0)
        placed = lead_hand(hips, leant, 0, target, weight, normal, np.zeros((12, 3)))
        wrist, world = forward_kinematics(hips, placed)
        np.testing.assert_allclose(wrist[:, ARMS[0][2]], target, atol=2e-3)
        assert np.isfinite(world).all()


def test_a_leaf_let_go_comes_to_rest():
    for speed in (0.0, 0.01, 0.03, 0.06):
        angles = np.append(0.8, swing_on(0.8, speed, 1.6, 90))
        assert (
            np.diff(angles).min() > -1e-6
            and abs(angles[1] - angles[0] - speed) < 0.01
            and angles[-1] == angles[-2] >= 1.6 - 1e-9
        )
