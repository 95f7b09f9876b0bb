"""Who is steered goes where keys say, off what is solid, and goals take over and give back without a pop."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.actions.steer import RUNS, WALKS
from nsm_core.control.goals import Goal, Steering
from nsm_core.control.live import LiveTake
from nsm_core.control.locomotion import Answer, Trajectory
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.conventions import RUN, SIT
from nsm_core.errors import GoalError
from nsm_core.evaluation.furniture_goals import sit_goal
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import heading_to_direction, wrap_angle
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene import furniture

CHAIR = furniture.make("chair", np.random.default_rng(90001))
SEAT = np.array((2.5, 3.0))
WALKING, RUNNING = Answer(1.5, 1.1, 0.9), Answer(2.8, 2.4, 2.5)
FRAMES = {"turn": 60, "run": 120, "stop": 180, "spin": 240, "sit": 300, "leave": 560, "end": 680}


def ahead(degrees: float, pace: float = WALKS) -> np.ndarray:
    return pace * heading_to_direction(np.radians(degrees))


def led(steering: Steering, live: LiveTake, velocity, heading=None) -> None:
    live.take_back()
    steering.velocity, steering.heading = np.asarray(velocity, dtype=np.float64), heading


@pytest.fixture(scope="module")
def take() -> TakeResult:
    """Walks, turns back, runs, stops, turns on the spot, sits down by itself and walks off again."""
    solids = furniture.cuboids([(CHAIR, SEAT, 0.0)])
    live = LiveTake(load_model(backend="numpy"), TakeRequest(np.zeros(2), 0.0, [], solids, contact_ik=False))
    steering = live.steering
    orders = {
        0: lambda: led(steering, live, ahead(0)),
        FRAMES["turn"]: lambda: led(steering, live, ahead(180)),
        FRAMES["run"]: lambda: led(steering, live, ahead(180, RUNS)),
        FRAMES["stop"]: lambda: led(steering, live, (0, 0)),
        FRAMES["spin"]: lambda: led(steering, live, (0, 0), heading=np.pi / 2),
        FRAMES["sit"]: lambda: live.hand_over(sit_goal(CHAIR, SEAT, 0.0)),
        FRAMES["leave"]: lambda: led(steering, live, ahead(-90)),
    }
    for frame in range(FRAMES["end"]):
        orders.get(frame, lambda: None)()
        live.step()
    live.stop()
    return live.runner.result()


def test_it_goes_where_it_is_steered(take):
    velocity = np.diff(take.root[:, :2], axis=0) * 30

    def mean(frame: int) -> np.ndarray:
        return velocity[frame - 10 : frame].mean(0)

    assert mean(FRAMES["turn"]) == pytest.approx(ahead(0), abs=0.15), "it walks within two seconds"
    assert mean(FRAMES["run"])[1] > 0.4, "and back within two, around a bend"
    assert mean(FRAMES["stop"])[1] == pytest.approx(RUNS, rel=0.15) and take.action[FRAMES["stop"], RUN] > 0.9
    assert np.linalg.norm(mean(FRAMES["spin"])) < 0.5, "it all but stands two seconds after a run"
    turned = wrap_angle(take.root[FRAMES["sit"], 2] - np.pi / 2)
    assert abs(turned) < 0.35 and np.linalg.norm(mean(FRAMES["sit"])) < 0.15
    assert take.action[FRAMES["leave"], SIT] > 0.9, "it sits until it is steered"
    assert mean(FRAMES["end"]) == pytest.approx(ahead(-90), abs=0.3)
    assert [g.reached for g in take.goals] == [True, True, True]
    assert take.goals[0].remarks[0].startswith("steered for 9.")


@pytest.mark.parametrize("switch", ["sit", "leave"])
def test_goals_take_over_and_give_back_without_a_pop(take, switch):
    joints = forward_kinematics(take.network_hips, take.network_rotations)[0]
    jumps = np.linalg.norm(np.diff(30 * np.diff(joints, axis=0), axis=0), axis=-1).max(1)  # m/s of any joint
    frame = FRAMES[switch]
    rest = np.concatenate((jumps[: FRAMES["sit"]], jumps[FRAMES["sit"] + 60 : FRAMES["leave"]]))
    assert jumps[frame - 2 : frame + 15].max() < np.percentile(rest, 99.5)


def test_a_goal_breaks_in_while_it_runs_and_one_that_cannot_be_reached_changes_nothing():
    wall = Cuboids([((0, -9.0), 0.0, [(-300, -0.2, 0)], [(300, 0.2, 2)])])
    live = LiveTake(load_model(backend="numpy"), TakeRequest(np.zeros(2), 0.0, [], wall, contact_ik=False))
    live.steering.velocity = ahead(0, RUNS)
    for _ in range(60):
        live.step()
    with pytest.raises(GoalError, match="cannot be reached"):
        live.hand_over(Goal("walk", "far", np.array((0, -12.0, 0)), 0.0))
    assert live.performs is None
    live.hand_over(Goal("walk", "near", np.array((1.5, -1.0, 0)), 0.0))
    assert live.performs is not None
    for _ in range(240):
        live.step()
    result = live.runner.result()
    assert np.linalg.norm(result.root[-1, :2] - (1.5, -1.0)) < 0.3
    joints = forward_kinematics(result.network_hips, result.network_rotations)[0]
    jumps = np.linalg.norm(np.diff(30 * np.diff(joints, axis=0), axis=0), axis=-1).max(1)
    assert jumps[58:75].max() < 1.5 * np.percentile(jumps, 99)


def floor(*boxes) -> FloorPlan:
    return FloorPlan(Cuboids([((x, y), 0.0, [low], [high]) for x, y, low, high in boxes]), ((-9, -9), (9, 9)))


def laid(velocity, plan: FloorPlan | None, answer=WALKING, pace=(0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    course = Trajectory()
    course.lay(
        np.zeros(2), np.array(pace), 0.0, Steering(np.asarray(velocity, dtype=np.float64)), answer, plan
    )
    places, _, paces = course.preview(0.0, tuple(range(61)))
    return places, paces


def test_what_is_wanted_is_led_to_in_two_seconds():
    places, paces = laid(ahead(0), None)
    assert paces[-1] == pytest.approx(WALKS, abs=0.01) and (np.diff(paces) >= -1e-9).all()
    assert (places[:, 0] == pytest.approx(0)) and places[-1, 1] < -1.5
    _, braking = laid((0, 0), None, RUNNING, ahead(0, RUNS))
    assert braking[-1] < 0.05 and (np.diff(braking) <= 1e-9).all()
    back, paces = laid(ahead(180), None, WALKING, ahead(0))
    assert paces.min() < 0.7 and abs(back[-1, 0]) > 0.2, "who turns back slows down and goes around"


def test_it_keeps_off_solids_and_slides_along_walls():
    wall = floor((0, -1.2, (-4, -0.1, 0), (4, 0.1, 2)))
    places, paces = laid(ahead(0, RUNS), wall, RUNNING, ahead(0, RUNS))
    assert wall.clearance(places).min() > wall.radius - 0.1 and paces[-1] < 0.2, "between two looks"
    slid, paces = laid(ahead(45), wall, WALKING, ahead(45))
    assert wall.clearance(slid).min() > wall.radius - 0.05 and slid[-1, 0] > 1.0 and paces[-1] > 0.4
    inside = floor((0, 0, (-0.2, -0.2, 0), (0.2, 0.2, 0.5)))
    assert laid(ahead(0), inside)[0][-1, 1] < -1.0, "who stands in something may leave it"
