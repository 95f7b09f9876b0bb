"""Ways of hands on layouts: what is judged of them, what plans them, and the table."""

from __future__ import annotations

import json

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from nsm_core.commands import planner as command
from nsm_core.control.hand_plan import HandScene, LikeWay, hand_scene, known_end, plan_way
from nsm_core.evaluation.hand_layouts import layouts, scaled
from nsm_core.evaluation.hand_rivals import a_star, fast_marching, minimum_jerk, straight
from nsm_core.evaluation.hand_ways import clear, judge
from nsm_core.model.inference.field_model import FieldModel, KnownFields
from nsm_core.model.networks.field_config import FieldConfig
from nsm_core.model.networks.field_decoder import FieldDecoder
from nsm_core.model.networks.protocol import Weights
from nsm_core.world.assets.kitchen import make_kitchen
from nsm_core.world.planning.hand_fields import grid_around
from nsm_core.world.scene.wrist import WristPose


@pytest.fixture(scope="module")
def tasks():
    return [*layouts(2, False), *layouts(2, True)]


def test_layouts_are_of_their_seed_and_the_same_again(tasks):
    again = next(layouts(1, False))
    assert np.array_equal(again.wrist.place, tasks[0].wrist.place)
    assert np.array_equal(again.space.obstacles, tasks[0].space.obstacles)
    assert [task.laden for task in tasks] == [False, True, False, True]


def test_a_scaled_cupboard_opens_and_holds_as_it_did():
    kitchen = make_kitchen(3)
    piece = next(c for c in kitchen.containers.values() if any(p.kind == "drawer" for p in c.parts))
    scale = np.array((1.4, 0.8, 1.2))
    larger = scaled(piece, scale)
    assert np.allclose(larger.piece.size, piece.piece.size * scale, atol=1e-5)
    for before, after in zip(piece.boards, larger.boards, strict=True):
        assert np.allclose(after.size, before.size * scale[:2]) and np.isclose(after.room, before.room * 1.2)
    drawer, wide = (next(p for p in c.parts if p.kind == "drawer") for c in (piece, larger))
    assert np.isclose(wide.travel, drawer.travel * 0.8)
    drawer.opening = wide.opening = 1.0
    assert np.allclose(wide.to_world(wide.handle), drawer.to_world(drawer.handle) * scale)


def test_what_plans_without_learning_ends_at_the_grasp_and_mostly_touches_nothing(tasks):
    for planner in (fast_marching, a_star, minimum_jerk, straight):
        ways = [planner(task) for task in tasks]
        assert all(np.allclose(way[-1], task.wrist.place) for way, task in zip(ways, tasks, strict=True))
    assert judge(fast_marching, tasks).success == 1 and judge(a_star, tasks).success >= 0.75


def test_a_way_through_something_is_none(tasks):
    task = tasks[0]
    low, high = np.array((-9.0, -9.0, -0.5)), np.array((9.0, 9.0, -0.4))  # under the floor
    through = np.linspace(low, high, 30)
    through = np.concatenate((through, task.wrist.place[None]))
    assert not clear(task, through) and judge(lambda _: through, [task]).success == 0
    assert judge(lambda _: None, [task]).success == 0


def planned(model, task, **options):
    like = known_end(WristPose(task.to_own(task.wrist.place), task.rotation), task.laden)
    around = hand_scene(task.space, like, task.thing if task.laden else None)
    return plan_way(model, around, task.condition, task.task, like, **options), around, like


class Towards(FieldModel):
    """Fields that are known exactly: a hand arrives straight, at half a metre a second."""

    def __init__(self, end):
        torch.manual_seed(0)
        config = FieldConfig(width=8, layers=2, again=1, latent=4, encoder=4, block=2)
        net = FieldDecoder(config)
        values = {n.replace("/", "."): v.detach().numpy() for n, v in net.values.items()}
        scales = {"field_scale": net.field_scale.numpy(), "query_scale": net.query_scale.numpy()}
        super().__init__(config, Weights(values, scales))
        self.end = end

    def fields(self, places, condition, code):
        told = np.zeros((len(places), 3))
        told[:, 2] = 0.5 / np.maximum(np.linalg.norm(places - self.end, axis=1), 1e-3)
        return told

    def arrival(self, places, condition, code):
        way = places - self.end
        far = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-3)
        return 0.5 / far[:, 0], -0.5 * way / far**3


def far_one(tasks):
    """The task whose hand comes from farthest, and where its straight end begins."""
    task = max(tasks, key=lambda one: np.linalg.norm(one.begin - one.wrist.place))
    return task, known_end(WristPose(task.to_own(task.wrist.place), task.rotation), task.laden).path[0]


def test_a_hand_goes_down_the_field_as_fast_as_it_says_and_ends_as_is_known(tasks):
    task, entered = far_one(tasks)
    plan, _, like = planned(Towards(entered), task, keep_off=False)
    assert plan.arrived and np.allclose(plan.path[-1], like.path[-1])
    assert np.allclose(plan.rotations @ plan.rotations.transpose(0, 2, 1), np.eye(3), atol=1e-6)
    speed = np.linalg.norm(np.diff(plan.path, axis=0), axis=1) * 30
    assert abs(speed.max() - 0.5) < 0.05


def test_a_hand_is_pushed_off_a_wall_that_the_field_leads_along():
    points = grid_around(np.zeros(3))
    nothing = np.zeros(points.shape[:3])
    known = KnownFields(points, nothing, nothing, np.zeros((1, 3)), np.zeros(1))
    scene = HandScene(known, points[..., 2] + 0.1, 0.045)  # a floor at -0.1
    like = LikeWay(np.array(((0.0, 0.25, -0.06), (0.0, 0.3, -0.06))), np.repeat(np.eye(3)[None], 2, 0))
    task = np.array((0, 0.3, -0.06, 0, 1, 0, 0, -0.3, -0.08))
    model, lowest = Towards(like.path[0]), []
    for keep_off in (False, True):
        plan = plan_way(model, scene, np.zeros(4), task, like, keep_off=keep_off)
        middle = plan.path[np.abs(plan.path[:, 1]) < 0.1]
        lowest.append(float(middle[:, 2].min()))
    assert lowest[0] < -0.07 and lowest[1] > -0.06


def test_the_command_trains_and_compares(tmp_path, capsys):
    asked = ["--run", str(tmp_path), "--kitchens", "2", "--things", "1", "--minutes", "0.02"]
    asked += ["--threads", "1", "--width", "16", "--rivals", "3", "--layouts", "1"]
    assert command.main(asked) == 0
    rows = json.loads((tmp_path / "table.json").read_text())
    names = {row["ways"] for row in rows}
    assert {"planner", "diffusion", "planner without target", "minimum jerk"} <= names
    assert {row["layouts"] for row in rows} == {"plain", "reshaped"}
    assert all(row["seconds"] >= 0 for row in rows)
    told = capsys.readouterr().out
    assert "| fast marching |" in told and "(98.80)" in told
    assert command.main([*asked, "--table", "--descent"]) == 0
    assert "| a guess | 1 |" in capsys.readouterr().out
