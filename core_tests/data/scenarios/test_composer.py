"""Training data composed from captures: seats under the hips, no pops, no walking through seats, the same by
seed.
"""

from __future__ import annotations

import json
from pathlib import Path

import captures
import numpy as np
import pytest

from nsm_core.body.inertialization import BLEND_FRAMES, soften_seam
from nsm_core.body.skeleton import FEET, HIP_OVER_SEAT, HIPS, forward_kinematics
from nsm_core.body.thin_capsules import thin_depths
from nsm_core.conventions import CARRY, GOAL_ACTIONS, IDLE, SIT, WALK
from nsm_core.data import coverage
from nsm_core.data.export import export, is_held_back
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.data.scenarios.furnishing import furnish
from nsm_core.data.scenarios.session import Session
from nsm_core.data.scenarios.take import ComposedTake, annotate, goal_tables, phase_of, styles_of
from nsm_core.data.storage import Dataset
from nsm_core.errors import CaptureError, OutputError, SkeletonError
from nsm_core.rotations import quat_conjugate, quat_mul, quat_to_rotvec, rotate_planar, wrap_angle
from nsm_core.world.scene import furniture
from nsm_core.world.sensors.environment import environment_sensor

pytestmark = pytest.mark.slow  # goldens compare what is composed of every action under any numpy


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return captures.capture_folder(tmp_path_factory)


@pytest.fixture(scope="module")
def takes(folder) -> tuple[ComposedTake, ...]:
    return captures.takes(folder)


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Dataset:
    return captures.dataset(captures.data_folder(tmp_path_factory))


def sits_of(take: ComposedTake) -> list[tuple[int, int]]:
    """First and one-past-last frames seated, in the order of the take's seats."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], take.contacts[:, 0] > 0.5, [False])).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def test_seats_stand_under_the_hips_and_goals_at_them(takes):
    seats = 0
    for take in takes:
        chairs = [t for t in take.things if t.furniture.seat is not None]
        assert len(sits_of(take)) == len(chairs)
        root = annotate(take).root
        for (a, b), placed in zip(sits_of(take), chairs, strict=True):
            seats += 1
            goal = next(c for c in take.commands if c.thing >= 0 and take.things[c.thing] is placed)
            assert goal.action == "sit" and goal.frame < a
            # Once there, the hips rest at the goal: captured sway would teach a region, not a place.  Who
            # turns to a table gets there with the turn, and leaves it with the turn back.
            off = np.linalg.norm(take.hips[a + 3 : b] - goal.position, axis=1)
            resting = a + 3 + np.flatnonzero(off < 0.005)
            assert off.max() < 0.15 and len(resting) > 30
            turned = np.abs(wrap_angle(root[resting, 2] - goal.heading))
            # A turn to a table begins and ends slowly.
            assert turned.mean() < 0.02 and np.median(turned) < 0.005
            seat = placed.furniture.seat
            assert goal.position[2] == pytest.approx(seat.height + HIP_OVER_SEAT, abs=0.015)
            on_seat = placed.position + rotate_planar(seat.point[:2], np.float64(placed.heading))
            assert np.linalg.norm(on_seat - goal.position[:2]) < 0.06
            assert wrap_angle(placed.heading + seat.heading - goal.heading) == pytest.approx(0, abs=1e-6)
    assert seats >= 2


def test_nobody_walks_through_furniture(takes):
    pieces = 0
    for take in takes:
        standing = take.labels[:, SIT] < 0.3
        for group, allowed in ((take.things, 0.09), (take.obstacles, 0.05)):
            pieces += len(group)
            for p in group:
                solid = furniture.cuboids([(p.furniture, p.position, p.heading)])
                assert (
                    thin_depths(take.hips[standing], take.rotations[standing], solid).max(initial=0) < allowed
                )
        root = annotate(take).root[standing, :2]
        for p in take.obstacles + take.things:
            local = rotate_planar(root - p.position, np.full(len(root), -p.heading))
            inside = (local > p.furniture.mins[:, :2].min(0) + 0.1) & (
                local < p.furniture.maxs[:, :2].max(0) - 0.1
            )
            assert not inside.all(1).any(), f"somebody stands in a {p.furniture.kind}"
    assert pieces > 3


def test_feet_that_stand_stay_where_they_are(takes):
    for take in takes:
        positions, _ = forward_kinematics(take.hips, take.rotations)
        for side, column in ((0, 3), (1, 4)):
            toe, on = positions[:, FEET[side][3]], take.contacts[:, column] > 0.5
            both = on[1:] & on[:-1]
            speed = np.linalg.norm(np.diff(toe[:, :2], axis=0), axis=1)[both] * 30
            # Between two places close in time a foot may give up the ends of its stands, and nothing else
            # moves.
            assert both.mean() > 0.4 and (speed > 0.02).mean() < 0.03 and np.median(speed) < 1e-3
            assert (toe[on, 2] > 0.08).mean() < 0.03
        assert positions[..., 2].min() > -0.005


def test_seams_do_not_show(takes, folder):
    """Nothing moves faster in the stitched takes than in the captures themselves, a margin aside."""
    lib = captures.source(folder).library

    def fastest(hips, rotations, among):
        step = np.linalg.norm(np.diff(hips, axis=0), axis=1)[among]
        turn = np.linalg.norm(
            quat_to_rotvec(quat_mul(rotations[1:], quat_conjugate(rotations[:-1]))), axis=-1
        )[among]
        return step.max(), turn.max(axis=0)

    step, turn = fastest(lib.hips, lib.rotations, lib.start[1:] == lib.start[:-1])
    for take in takes:
        mine, turns = fastest(take.hips, take.rotations, slice(None))
        assert mine < 1.6 * step, "the hips jump"
        assert (turns < 1.5 * turn + 0.25).all(), "a joint jumps"
        assert np.linalg.norm(np.diff(take.hips, n=2, axis=0), axis=1).max() < 0.02


def test_a_seam_is_softened_in_place_and_speed():
    t = np.arange(60)
    hips = np.stack((0.03 * t, 0 * t, 0.9 + 0 * t), axis=1)
    hips[30:] += (0.1, 0.2, -0.05)  # a jump
    hips[30:, 1] += 0.01 * (t[30:] - 30)  # and another speed
    rotations = np.tile(np.array((1.0, 0, 0, 0)), (60, 23, 1))
    rotations[30:, 5] = (np.cos(0.3), 0, 0, np.sin(0.3))
    before, turned = hips.copy(), rotations.copy()
    soften_seam(hips, rotations, 30)
    np.testing.assert_array_equal(hips[:30], before[:30])
    np.testing.assert_allclose(hips[30 + BLEND_FRAMES :], before[30 + BLEND_FRAMES :], atol=1e-9)
    np.testing.assert_allclose(rotations[30 + BLEND_FRAMES :], turned[30 + BLEND_FRAMES :], atol=1e-9)
    assert (
        np.abs(np.diff(before, n=2, axis=0)).max() > 0.15 and np.abs(np.diff(hips, n=2, axis=0)).max() < 0.02
    )
    turn = np.linalg.norm(quat_to_rotvec(quat_mul(rotations[1:], quat_conjugate(rotations[:-1]))), axis=-1)
    assert turn.max() < 0.12


def test_the_same_seed_composes_the_same_take(folder, takes):
    seed, a = next(iter(captures.seeded(folder).items()))
    b = Composer(captures.source(folder), {"sit": 0.68, "walk": 0.27, "run": 0.05}).compose(seed)
    np.testing.assert_array_equal(a.hips, b.hips)
    np.testing.assert_array_equal(a.rotations, b.rotations)
    assert [c.frame for c in a.commands] == [c.frame for c in b.commands] and len(a.obstacles) == len(
        b.obstacles
    )
    assert not np.array_equal(takes[1].hips[:50], takes[0].hips[:50])


def test_labels_and_phase_follow_the_motion(takes):
    for take in takes:
        a = annotate(take)
        np.testing.assert_allclose(a.style.sum(1), 1, atol=1e-5)
        assert (a.style >= -1e-6).all()
        seated = take.contacts[:, 0] > 0.5
        assert (a.style[seated, SIT] == 1).all()
        speed = np.linalg.norm(np.gradient(a.root[:, :2], axis=0), axis=1) * 30
        assert (a.style[(speed > 0.8) & ~seated, WALK] > 0.5).all()
        steps = np.diff(a.phase)
        assert (steps > 0).all() and steps.max() <= 0.1 + 1e-6 and 0.4 < steps.mean() * 30 < 2
        np.testing.assert_allclose(a.joint_velocity[1:], np.diff(a.joint_position, axis=0) * 30, atol=1e-3)


def test_rules_of_labels_and_phase_by_hand():
    root = np.stack((np.concatenate((np.zeros(30), np.cumsum(np.full(30, 0.04)))), np.zeros(60)), axis=1)
    labels = np.zeros((60, 7))
    labels[:10, SIT] = 0.5
    labels[5:20, CARRY] = 1
    style = styles_of(root, labels)
    assert style[10, CARRY] == 1 and style[10, [IDLE, WALK]].sum() == pytest.approx(1, abs=1e-3)
    np.testing.assert_allclose(style[5, [IDLE, WALK, SIT]], (0.5, 0, 0.5), atol=1e-3)
    np.testing.assert_allclose(style[55, [IDLE, WALK, SIT]], (0, 1, 0), atol=1e-3)
    contacts = np.ones((90, 2), bool)
    contacts[20:30, 1] = contacts[50:60, 1] = False  # the left foot lands at 30 and at 60
    phase = phase_of(contacts, np.ones(90), [], 90)
    assert phase[60] - phase[30] == pytest.approx(1) and phase[30] == pytest.approx(round(float(phase[30])))
    assert phase[45] - phase[30] == pytest.approx(0.5)


def test_past_keys_keep_the_commands_of_their_time(takes):
    take = next(t for t in takes if t.things)
    a = annotate(take)
    position, heading, action = goal_tables(take, a)
    c = next(c for c in take.commands if c.thing >= 0)
    f, sit = c.frame, GOAL_ACTIONS.index("sit")
    assert (
        (action[f - 1, :, sit] == 0).all()
        and (action[f, 6:, sit] == 1).all()
        and (action[f, :6, sit] == 0).all()
    )
    for later in (f + 7, f + 16, f + 29):
        keys = later + 5 * np.arange(-6, 7)
        np.testing.assert_array_equal(action[later, :, sit], (keys >= f) | (np.arange(13) >= 6))
    np.testing.assert_allclose(position[f + 10, 6:], np.tile(c.position, (7, 1)))
    np.testing.assert_allclose(heading[f + 10, 6:], c.heading, atol=1e-6)
    for t in range(f, f + 30):  # a past key is what that frame's own pivot asked for
        np.testing.assert_array_equal(position[t, :6], [position[max(t + k, 0), 6] for k in range(-30, 0, 5)])


def test_a_led_walk_has_its_goal_a_second_ahead(takes):
    take, c, index = next((t, c, n) for t in takes for n, c in enumerate(t.commands) if c.position is None)
    a = annotate(take)
    position, heading, _ = goal_tables(take, a)
    end = take.commands[index + 1].frame if index + 1 < len(take.commands) else len(take)
    for f in range(c.frame, min(end, len(take) - 61), 9):
        ahead = f + 30 + 5 * np.arange(7)
        np.testing.assert_allclose(position[f, 6:, :2], a.root[ahead, :2], atol=1e-6)
        np.testing.assert_allclose(heading[f, 6:], a.root[ahead, 2], atol=1e-6)


def test_exported_arrays_are_the_takes_and_their_sensors(tmp_path_factory, folder, data):
    """What is stored in order is what composing again gives, and the environment is the sensor's at that
    root.
    """
    meta = json.loads((captures.data_folder(tmp_path_factory) / "data.json").read_text())
    assert meta["frames"] == len(data.arrays["root"]) >= 2700 and meta["objects"] == len(
        data.arrays["object_cells"]
    )
    objects = 0
    for seed, about in meta["takes"].items():
        take = captures.exported(folder, int(seed))
        a, first = annotate(take), about["start"]
        rows = slice(first, first + len(take))
        np.testing.assert_array_equal(data.arrays["root"][rows], a.root)
        np.testing.assert_array_equal(data.arrays["joint_position"][rows], a.joint_position)
        assert (data.arrays["start"][rows] == first).all() and (
            data.arrays["end"][rows] == first + len(take)
        ).all()
        # On stairs the floor rises with the walker: ``test_stair_data`` looks at what is sensed there.
        for f in range(0, len(take) if take.level is None else 0, 97):
            there = [(p.furniture, p.position, p.heading) for p in take.obstacles]
            poses = [(t.furniture, t.track(len(take))[f]) for t in take.things]
            scene = furniture.cuboids(there + [(piece, pose[:3], float(pose[3])) for piece, pose in poses])
            values = environment_sensor(scene, a.root[f, :2].astype(np.float64), float(a.root[f, 2]))
            np.testing.assert_allclose(data.arrays["environment"][first + f] / 255, values, atol=0.003)
        which = data.arrays["object"][rows]
        assert set(which[which >= 0]) == set(range(objects, objects + len(take.things)))
        assert (which[a.style[:, SIT] > 0.25] >= 0).all()
        objects += len(take.things)
        known = set(captures.source(folder).library.names)
        assert {name for name, _, _, _ in about["pieces"]} <= known
        assert all(0 <= i < len(take) * 9 and i <= j for _, i, j, _ in about["pieces"])
        clips = np.repeat(
            [name.rstrip("~") for name, _, _, _ in about["pieces"]], [n for *_, n in about["pieces"]]
        )
        np.testing.assert_array_equal(data.arrays["validates"][rows], [is_held_back(c) for c in clips])
    assert data.arrays["environment"].max() > 200 and data.arrays["object_occupancy"].max() == 1
    assert (
        meta["stance"]["hips_height"] == pytest.approx(0.89, abs=0.01)
        and len(meta["stance"]["local_rotations"]) == 23
    )


def test_states_reach_over_no_border_of_a_take(data):
    a = data.arrays
    second = int(np.unique(a["start"])[1])
    state = data.state(np.array([second + 2]))
    np.testing.assert_array_equal(state.root_past[0, :29], np.tile(a["root"][second], (29, 1)))
    np.testing.assert_array_equal(state.root_past[0, -1], a["root"][second + 2])
    last = int(data.frames[data.frames < second].max())
    np.testing.assert_array_equal(data.state(np.array([last])).root_future[0, -1], a["root"][last + 30])
    assert last + 30 < second and second - last == 32


def test_furniture_is_put_beside_the_path_and_never_on_it(takes, folder):
    take = ComposedTake(takes[0].hips, takes[0].rotations, takes[0].contacts, takes[0].labels, [])
    roots = annotate(take).root[:, :2]
    session = Session(captures.source(folder), np.random.default_rng(3))
    session.detours.append(roots[len(roots) // 2] + 0.3)
    furnish(take, roots, session, session.rng)
    assert take.obstacles
    for p in take.obstacles:
        solid = furniture.cuboids([(p.furniture, p.position, p.heading)])
        points = np.concatenate([np.insert(roots, 2, z, axis=1) for z in np.arange(0.05, 1.6, 0.1)])
        # Beside an opening that is walked through there may be a little less room.
        assert solid.signed_distance(points.astype(np.float32), 1.0).min() >= 0.34


def test_folders_that_are_no_captures_or_no_data(tmp_path, folder):
    with pytest.raises(CaptureError, match=r"is no folder; name the one with the captures\.$"):
        export(str(tmp_path / "nowhere"), tmp_path / "out", 0.1)
    with pytest.raises(CaptureError, match=r"holds no finished training data; compose it again\.$"):
        Dataset.open(tmp_path / "out")
    (tmp_path / "out" / "data.json").write_text('{"frames": 3')
    with pytest.raises(CaptureError, match="holds no finished training data"):
        Dataset.open(tmp_path / "out")


def damaged(tmp_path: Path) -> str:
    folder = captures.write_captures(tmp_path)
    sit = folder / "wednesday" / "sit_0.bvh"
    sit.write_text(sit.read_text().replace("JOINT LeftWrist", "JOINT gizmo"))
    return str(folder)


def test_damaged_captures_are_named(tmp_path):
    with pytest.raises(SkeletonError, match=r"sit_0\.bvh lacks the bones LeftWrist"):
        load(damaged(tmp_path))


def test_damaged_captures_stop_an_export_with_their_name(tmp_path):
    with pytest.raises(SkeletonError, match=r"sit_0\.bvh lacks the bones LeftWrist"):
        export(damaged(tmp_path), tmp_path / "out", 0.1, workers=1)


def test_hips_stay_under_a_walkers_speed(takes):
    for take in takes:
        assert np.linalg.norm(np.diff(take.hips[:, :2], axis=0), axis=1).max() * 30 < 2.2
        positions, _ = forward_kinematics(take.hips, take.rotations)
        assert np.abs(positions[:, HIPS] - take.hips).max() < 1e-6


def test_coverage_counts_goals_by_kind_and_draws_them(tmp_path_factory, folder, data, tmp_path):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    where = captures.data_folder(tmp_path_factory)
    meta = json.loads((where / "data.json").read_text())
    found = coverage.approaches(data)
    asked = {"sit": 0, "open: reach": 0}
    for seed in meta["takes"]:
        take = captures.exported(folder, int(seed))
        actions = ["", *(c.action for c in take.commands)]
        for kind, action in zip(asked, ("sit", "open"), strict=True):
            asked[kind] += sum(
                now == action != before for before, now in zip(actions[:-1], actions[1:], strict=True)
            )
    assert sum(asked.values()) > 0
    for kind, count in asked.items():
        assert len(found[kind].distance) == count
        assert (
            (found[kind].distance < 6).all()
            and (found[kind].bearing <= 180).all()
            and (found[kind].height > 0.3).all()
        )
    glides = coverage.gliding(data)
    assert {"walk", "idle"} <= set(glides)
    assert all(share < 0.15 and speed < 5 for share, speed in glides.values()), glides
    text = coverage.report(where)
    seams = coverage.at_seams(data, list(meta["takes"].values()))
    assert seams is not None and seams.stand < 5 and f"of {seams.count} places where they meet" in text
    assert f"in {len(meta['takes'])} takes" in text and all(
        f"{kind}: {count} goals" in text for kind, count in asked.items() if count
    )
    assert coverage.draw_coverage(where, tmp_path / "coverage.png").stat().st_size > 20_000
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="choose another folder"):
        coverage.draw_coverage(where, tmp_path / "file" / "coverage.png")
