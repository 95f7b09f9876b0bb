"""Features: the same for training and for stepping, as the paper's equations say, and blind to where the
world lies.
"""

from __future__ import annotations

from dataclasses import replace

import captures
import numpy as np
import pytest
from mirrors import ENVIRONMENT_MIRROR, INTERACTION_MIRROR

from nsm_core.body.clip import transform
from nsm_core.body.skeleton import MIRROR, mirror
from nsm_core.data.scenarios.take import ComposedTake, Placed, Thing, TimedCommand
from nsm_core.data.storage import Dataset
from nsm_core.model.features.codec import (
    SensorReading,
    build_gating,
    build_inputs,
    build_targets,
    integrate_position,
    no_object,
    read_outputs,
)
from nsm_core.model.features.layout import FRAME, GATING, GOAL, INPUT, INTERACTION, OUTPUT
from nsm_core.model.features.rollout_step import advance
from nsm_core.model.features.state import State
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.scene.furniture import cuboids
from nsm_core.world.sensors.environment import environment_sensor
from nsm_core.world.sensors.interaction import interaction_sensor


@pytest.fixture(scope="module")
def take(tmp_path_factory) -> ComposedTake:
    """A composed take with a seat and with obstacles about."""
    found = captures.takes(captures.capture_folder(tmp_path_factory))
    seats = (t for t in found if t.things and all(x.furniture.seat and not x.moves for x in t.things))
    return max(seats, key=lambda t: len(t.obstacles))


@pytest.fixture(scope="module")
def data(take) -> Dataset:
    return captures.data_of(take)


def sensed(take: ComposedTake, which: int, state: State) -> SensorReading:
    """What the product's own sensors read at a state: the way a take in Blender is fed."""
    scene = cuboids([(p.furniture, p.position, p.heading) for p in take.things + take.obstacles])
    environment = environment_sensor(scene, state.root[0, :2], float(state.root[0, 2]))
    cells, occupancy = no_object(state.root)
    if which >= 0:
        s = take.things[which]
        centre = s.furniture.centre.copy()
        centre[:2] = s.position + rotate_planar(centre[:2], np.float64(s.heading))
        volume = interaction_sensor(
            cuboids([(s.furniture, s.position, s.heading)]), centre, s.furniture.size, s.heading
        )
        cells, occupancy = volume.cells_world()[None], volume.occupancy[None]
    return SensorReading(environment[None], cells, occupancy)


def same_state(a: State, b: State, tolerance: float) -> None:
    for name in ("joint_position", "joint_forward", "joint_up", "style_past", "style_future"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=tolerance, err_msg=name)
    # Positions over a frame's time.
    np.testing.assert_allclose(a.joint_velocity, b.joint_velocity, atol=60 * tolerance)
    for name in ("root_past", "root_future"):
        x, y = getattr(a, name), getattr(b, name)
        np.testing.assert_allclose(x[..., :2], y[..., :2], atol=tolerance, err_msg=name)
        assert np.abs(wrap_angle(x[..., 2] - y[..., 2])).max() < tolerance, name
    for name in ("phase_past", "phase_future"):
        d = getattr(a, name) - getattr(b, name)
        assert np.abs(d - np.round(d)).max() < tolerance, name


def test_sizes_are_the_papers():
    assert (FRAME.size, GOAL.size, INTERACTION.size, GATING.size, OUTPUT.size) == (419, 143, 2048, 650, 605)
    parts = ("frame", "goal", "environment", "interaction")
    assert [INPUT.slices[n].stop - INPUT.slices[n].start for n in parts] == [419, 143, 1408, 2048]
    assert INPUT.size == 4018


def test_blocks_are_written_and_read_in_the_same_places():
    rng = np.random.default_rng(0)
    blocks = {name: rng.normal(size=(3, *shape)).astype(np.float32) for name, shape in OUTPUT.shapes.items()}
    vector = OUTPUT.pack(**blocks)
    assert vector.shape == (3, 605)
    for name, values in blocks.items():
        np.testing.assert_array_equal(OUTPUT.get(vector, name), values)
    assert (
        sorted(s.start for s in OUTPUT.slices.values())[1:]
        == sorted(s.stop for s in OUTPUT.slices.values())[:-1]
    )


def test_targets_read_back_give_the_following_frame(data):
    frames = np.arange(3, len(data.frames) - 1, 23)
    state, following = data.state(frames), data.state(frames + 1)
    contact = data.arrays["contact"][frames + 1]
    read = read_outputs(build_targets(state, following, contact), state)
    for name in ("joint_position", "joint_forward", "joint_up", "joint_velocity"):
        np.testing.assert_allclose(getattr(read, name), getattr(following, name), atol=5e-5, err_msg=name)
    np.testing.assert_allclose(read.future_joint_position, following.joint_position, atol=2e-5)
    np.testing.assert_allclose(integrate_position(state, read), following.joint_position, atol=2e-5)
    for view in (read.root, read.root_goalward):
        np.testing.assert_allclose(view[..., :2], following.root_keys()[:, 6:, :2], atol=2e-5)
        assert np.abs(wrap_angle(view[..., 2] - following.root_keys()[:, 6:, 2])).max() < 2e-5
    np.testing.assert_allclose(read.style, following.style_keys()[:, 6:], atol=1e-6)
    np.testing.assert_allclose(read.goal_position, following.goal_position, atol=2e-5)
    assert np.abs(wrap_angle(read.goal_heading - following.goal_heading)).max() < 2e-5
    np.testing.assert_array_equal(read.goal_action, following.goal_action)
    np.testing.assert_array_equal(read.contact, contact)


def test_stepping_on_true_outputs_walks_through_the_data(take, data):
    """A state stepped as the product steps it meets the data's own states and features, frame after frame."""
    a, worst = data.arrays, 0.0
    sits = np.flatnonzero((a["style"][:, 5] > 0.3) & (a["object"] >= 0))
    for first in (0, 40, int(sits[0]) - 20):
        state = data.state(np.array([first]))
        for f in range(first, first + 45):
            now, following = np.array([f]), np.array([f + 1])
            y = build_targets(data.state(now), data.state(following), a["contact"][following])
            state = advance(state, read_outputs(y, state))
            state.goal_position, state.goal_heading = (
                a["goal_position"][following],
                a["goal_heading"][following],
            )
            state.goal_action = a["goal_action"][following]
            same_state(state, data.state(following), 1e-3)
            if f % 5 == 0:
                true = data.state(following)
                x, g = build_inputs(state, sensed(take, int(a["object"][f + 1]), state))
                x2, g2 = build_inputs(true, data.surroundings(following, true.root))
                environment = INPUT.slices["environment"]
                # The data keeps occupancies in 255 steps.
                np.testing.assert_allclose(x[:, environment], x2[:, environment], atol=0.01)
                worst = max(worst, float(x2[:, environment].max()))
                x[:, environment] = x2[:, environment] = 0
                velocity = FRAME.slices["joint_velocity"]
                np.testing.assert_allclose(x[:, velocity], x2[:, velocity], atol=0.06)
                x[:, velocity] = x2[:, velocity] = 0
                np.testing.assert_allclose(x, x2, atol=2e-3)
                np.testing.assert_allclose(g, g2, atol=1e-2)
    assert worst > 0.5, "the sensors saw nothing, so nothing was compared"


def test_gating_is_the_papers_product_key_by_key(data):
    """Equations 5 to 7: labels, goal action, distance and angle, times (sin, cos) of the phase; inactive
    labels are -1.
    """
    state = data.state(np.array([17, 160, 300]))
    gating = build_gating(state).reshape(3, 13, 25, 2)
    for b in range(3):
        for k in range(13):
            root, phase = state.root_keys()[b, k], 2 * np.pi * state.phase_keys()[b, k]
            d = np.hypot(*(root[:2] - state.goal_position[b, k, :2]))
            turn = root[2] - state.goal_heading[b, k]
            angle = np.arccos(np.clip(np.cos(turn), -1, 1))
            features = [2 * s - 1 for s in state.style_keys()[b, k]]
            for action in state.goal_action[b, k]:
                sign = 2 * action - 1
                features += [sign, sign * d, sign * angle]
            expected = np.outer(features, (np.sin(phase), np.cos(phase)))
            np.testing.assert_allclose(gating[b, k], expected, atol=1e-3)


def elsewhere(take: ComposedTake, shift: np.ndarray, turn: float) -> ComposedTake:
    """The same take in a world turned by ``turn`` and moved by ``shift`` (2,)."""

    def move(p):
        return rotate_planar(np.asarray(p, np.float64)[:2], np.float64(turn)) + shift

    hips, rotations = transform(take.hips, take.rotations, shift.astype(np.float32), np.float32(turn))
    commands = [
        c
        if c.position is None
        else TimedCommand(
            c.frame, c.action, np.append(move(c.position), c.position[2]), c.heading + turn, c.thing
        )
        for c in take.commands
    ]
    things = [Thing.standing(p.furniture, move(p.position), p.heading + turn) for p in take.things]
    obstacles = [Placed(p.furniture, move(p.position), p.heading + turn) for p in take.obstacles]
    return replace(
        take, hips=hips, rotations=rotations, commands=commands, things=things, obstacles=obstacles
    )


def test_features_do_not_depend_on_the_place_in_the_world(take, data):
    other = captures.data_of(elsewhere(take, np.array((3.0, -2.0)), 2.2))
    frames = np.arange(0, len(data.frames), 29)
    for built in ("inputs", "targets"):
        results = []
        for d in (data, other):
            state = d.state(frames)
            if built == "inputs":
                x, g = build_inputs(state, d.surroundings(frames, state.root))
                results.append(np.concatenate((x, g), axis=1))
            else:
                results.append(build_targets(state, d.state(frames + 1), d.arrays["contact"][frames + 1]))
        np.testing.assert_allclose(results[0], results[1], atol=5e-3)
        assert results[0].std(axis=0).max() > 0.1


def test_a_reflected_world_gives_reflected_features(take, data):
    flip = np.array((-1.0, 1.0))
    reflected = [
        [
            make(
                replace(p.furniture, mins=m * (-1, 1, 1), maxs=n * (-1, 1, 1)), p.position * flip, -p.heading
            )
            for p, m, n in ((p, _swap(p, 0), _swap(p, 1)) for p in pieces)
        ]
        for make, pieces in ((Thing.standing, take.things), (Placed, take.obstacles))
    ]
    commands = [
        c
        if c.position is None
        else TimedCommand(c.frame, c.action, c.position * (-1, 1, 1), -c.heading, c.thing)
        for c in take.commands
    ]
    hips, rotations = mirror(take.hips, take.rotations)
    other = captures.data_of(
        ComposedTake(
            hips,
            rotations,
            take.contacts,
            take.labels,
            commands,
            reflected[0],
            reflected[1],
            phase_keys=take.phase_keys,
        )
    )
    frames = np.arange(0, len(data.frames), 31)
    (x, g), (x2, g2) = (
        build_inputs(d.state(frames), d.surroundings(frames, d.state(frames).root)) for d in (data, other)
    )
    np.testing.assert_allclose(g, g2, atol=2e-3)  # distances, angles and phases have no side
    frame, frame2 = (v[:, INPUT.slices["frame"]] for v in (x, x2))
    for name in ("joint_position", "joint_forward", "joint_up", "joint_velocity"):
        expected = FRAME.get(frame, name)[:, MIRROR] * (-1, 1, 1)
        np.testing.assert_allclose(FRAME.get(frame2, name), expected, atol=3e-3, err_msg=name)
    for name in ("trajectory_position", "trajectory_direction"):
        np.testing.assert_allclose(
            FRAME.get(frame2, name), FRAME.get(frame, name) * flip, atol=2e-3, err_msg=name
        )
    goal, goal2 = (v[:, INPUT.slices["goal"]] for v in (x, x2))
    np.testing.assert_allclose(
        GOAL.get(goal2, "goal_position"), GOAL.get(goal, "goal_position") * (-1, 1, 1), atol=2e-3
    )
    np.testing.assert_allclose(
        x2[:, INPUT.slices["environment"]],
        x[:, INPUT.slices["environment"]][:, ENVIRONMENT_MIRROR],
        atol=0.01,
    )
    volume, volume2 = (v[:, INPUT.slices["interaction"]] for v in (x, x2))
    cells = INTERACTION.get(volume, "cell_position")[:, INTERACTION_MIRROR] * (-1, 1, 1)
    np.testing.assert_allclose(INTERACTION.get(volume2, "cell_position"), cells, atol=2e-3)
    occupancy = INTERACTION.get(volume, "cell_occupancy")[:, INTERACTION_MIRROR]
    np.testing.assert_allclose(INTERACTION.get(volume2, "cell_occupancy"), occupancy, atol=2e-3)
    assert occupancy.max() > 0.9


def _swap(placed: Placed | Thing, which: int) -> np.ndarray:
    """Minima or maxima whose x exchange places, as a reflection at x = 0 wants before the sign changes."""
    f = placed.furniture
    a, b = (f.mins, f.maxs) if which == 0 else (f.maxs, f.mins)
    return np.concatenate((b[:, :1], a[:, 1:]), axis=1)
