"""Takes that go on from a pose and a pace: seated, in the middle of a walk, or as somebody has posed it."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import INDEX, J, forward_kinematics
from nsm_core.control.goals import Goal
from nsm_core.control.start import Start
from nsm_core.control.take import TakeRequest, TakeResult, roll
from nsm_core.conventions import FPS, SIT
from nsm_core.errors import GoalError
from nsm_core.evaluation.furniture_goals import sit_goal
from nsm_core.model.inference.model import Model, load_model
from nsm_core.rotations import quat_from_rotvec
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture

SEAT = furniture.make("chair", np.random.default_rng(1))
SOLIDS = Cuboids([((0.0, 0.0), 0.0, SEAT.mins, SEAT.maxs)])


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def walk_to(x: float, y: float) -> Goal:
    return Goal("walk", "place", np.array((x, y, 0.0)), 0.0, hold=0.2)


def take(model: Model, goals: list[Goal], start: Start | None = None) -> TakeResult:
    return roll(model, TakeRequest(np.array((1.0, -1.5)), 0.3, goals, SOLIDS, seed=1, start=start))


@pytest.fixture(scope="module")
def sit(model) -> TakeResult:
    return take(model, [sit_goal(SEAT, np.zeros(2), 0.0, hold=0.5)])


def joints(start: Start, made: TakeResult) -> np.ndarray:
    """Joints (T, 23, 3) of the last frames before a take and of the take."""
    hips, local = start.second()
    before = forward_kinematics(hips[-6:-1], local[-6:-1])[0]
    after = forward_kinematics(made.hips_position.astype(float), made.local_rotations.astype(float))[0]
    return np.concatenate((before, after))


def strongest(positions: np.ndarray, first: int, last: int) -> float:
    """The largest acceleration of a joint in these frames, m/s2."""
    bend = np.diff(positions[first:last], n=2, axis=0) * FPS**2
    return float(np.linalg.norm(bend, axis=-1).max())


@pytest.mark.parametrize("back", [75, 110])
def test_a_take_cut_in_the_middle_of_a_walk_goes_on_without_a_pop(model, sit, back):
    cut = len(sit.hips_position) - back
    start = Start(sit.hips_position[:cut], sit.local_rotations[:cut])
    made = take(model, [walk_to(1.2, -2.5)], start)
    assert made.goals[0].reached
    assert np.allclose(made.hips_position[0], start.hips[-1], atol=1e-6)
    assert np.allclose(np.abs((made.local_rotations[0] * start.local[-1]).sum(-1)), 1, atol=1e-6)
    path = joints(start, made)
    # A walk bends its joints' ways by some 30 m/s2; a pop of a few centimetres is 50 and more.
    assert strongest(path, 0, 20) < 45


def test_one_who_sits_rises_and_goes_on(model, sit):
    start = Start(sit.hips_position, sit.local_rotations, sit_goal(SEAT, np.zeros(2), 0.0))
    made = take(model, [walk_to(1.2, -2.5)], start)
    assert made.goals[0].reached and made.goals[0].position_error_cm < 10
    assert made.action[0, SIT] > 0.95 and made.action[-1, SIT] < 0.05
    assert np.abs(made.hips_position[:10] - made.hips_position[0]).max() < 0.01  # it does not hop up
    assert strongest(joints(start, made), 0, 25) < 45


def test_one_who_sits_where_it_should_sit_stays(model, sit):
    seat = sit_goal(SEAT, np.zeros(2), 0.0, hold=0.5)
    made = take(model, [seat], Start(sit.hips_position, sit.local_rotations, seat))
    assert made.goals[0].reached and made.goals[0].seconds < 1.5
    assert np.abs(made.hips_position - made.hips_position[0]).max() < 0.02


def posed(**turns: tuple[float, float, float]) -> Start:
    """One frame of the rest pose with these joints turned; the lower foot on the floor."""
    local = np.tile((1.0, 0.0, 0.0, 0.0), (1, J, 1))
    for joint, turn in turns.items():
        local[0, INDEX[joint]] = quat_from_rotvec(np.array(turn))
    hips = np.array([[1.0, -1.5, 0.97]])
    hips[0, 2] -= forward_kinematics(hips, local)[0][0, TOES, 2].min() - 0.025
    return Start(hips, local)


@pytest.mark.parametrize(
    "start",
    [
        posed(),
        posed(RightShoulder=(0, 1.4, 0), LeftShoulder=(0, -1.4, 0)),
        posed(RightHip=(-0.8, 0, 0), RightKnee=(0.9, 0, 0), LeftHip=(0.6, 0, 0)),
    ],
    ids=["T-pose", "arms over the head", "lunge"],
)
def test_a_posed_body_eases_into_the_take(model, start):
    made = take(model, [walk_to(1.2, -2.5)], start)
    assert made.goals[0].reached
    assert np.allclose(made.hips_position[0], start.hips[-1], atol=1e-6)
    path = joints(start, made)
    assert np.linalg.norm(np.diff(path, axis=0), axis=-1).max() * FPS < 5  # m/s
    assert strongest(path, 0, 30) < 60
    # After a second it is the network's own walk: arms hang.
    assert path[40:, INDEX["RightWrist"], 2].max() < 1.3


def test_what_cannot_be_gone_on_from_is_told():
    with pytest.raises(GoalError, match="get up"):
        posed(Hips=(-1.5, 0, 0))
    with pytest.raises(GoalError, match="no frames"):
        Start(np.zeros((0, 3)), np.zeros((0, J, 4)))
    with pytest.raises(GoalError, match="no numbers"):
        Start(np.full((1, 3), np.nan), np.tile((1.0, 0, 0, 0), (1, J, 1)))
