"""Trials are the same at every call and fair; what the network does in them becomes figures, tables and sheets."""

from __future__ import annotations

import json

import numpy as np
import pytest
from captures import data_folder

from nsm_core import furniture
from nsm_core.control.props import passage
from nsm_core.control.take import TakeResult
from nsm_core.conventions import CLIMB, FPS
from nsm_core.dataset.pool import Entry, Pool, scaled
from nsm_core.errors import GoalError, OutputError
from nsm_core.evaluation import carrying, climbing, doors, interruptions, locomotion, rollout, rooms, run, sitting, stress
from nsm_core.evaluation.baseline import _ground, slide_of_data
from nsm_core.evaluation.handling import box_in_solids
from nsm_core.evaluation.parts import ABLATIONS, PARTS, Figures
from nsm_core.features import INPUT
from nsm_core.inference import Model, load_model
from nsm_core.rotations import heading_to_direction, rotate_planar, wrap_angle
from nsm_core.sensors.cuboid import interaction_sensor
from nsm_core.skeleton import J


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def pool_of(*kinds: str) -> Pool:
    """A held-back pool of one piece of each kind."""
    rng = np.random.default_rng(5)
    return Pool([Entry(f"{k}.glb", k, furniture.make(k, rng), True) for k in kinds], mesh_share=1.0)


# --- scenes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PARTS)
def test_trials_are_the_same_at_every_call(name):
    first, second = (PARTS[name].trials(2, None) for _ in range(2))
    assert len(first) == len(second) > 1
    for a, b in zip(first, second, strict=True):
        assert a.name == b.name and a.setting == b.setting
        if hasattr(a, "start"):
            assert np.array_equal(a.start, b.start) and a.heading == b.heading


def test_starts_lie_about_the_object_and_are_free():
    for part in (carrying, doors, climbing):
        made = part.trials(4)
        for trial in made:
            asked = part.request(trial)
            middle = asked.goals[0].position[:2] if part is doors else np.zeros(2)
            assert 0.9 <= np.linalg.norm(trial.start - middle) <= 3.0
            assert rollout.clear_of(asked.environment, list(rollout.props_of(asked).values()), 0.34)(trial.start)
        facing = [wrap_angle(t.heading) for t in made]
        assert min(facing) < -1 and max(facing) > 1


def test_boxes_rest_on_what_is_under_them_at_both_ends():
    heights = set()
    for trial in carrying.trials(1):
        asked = carrying.request(trial)
        box = asked.goals[0].prop
        assert np.allclose(box.pose, trial.box, atol=1e-6) and np.allclose(asked.goals[0].position, trial.goal[:3])
        for pose in (trial.box, trial.goal):
            assert box_in_solids(box, pose[None], asked.environment) < 2e-3
            under = np.append(pose[:2], pose[2] - box.size[2] / 2 - 0.01)
            supported = under[2] < 0 or asked.environment.signed_distance(under[None].astype(np.float32), 1.0)[0] < 0
            assert supported, trial.name
            heights.add(round(float(under[2]), 1))
        assert np.linalg.norm(trial.goal[:2] - trial.box[:2]) > 2
    assert min(heights) <= 0 and max(heights) > 0.6 and any(0.2 < h < 0.6 for h in heights)


def test_doors_are_what_their_names_say():
    sizes = set()
    for trial in doors.trials(3):
        leaf = doors.request(trial).goals[0].prop
        way = passage(leaf, trial.start)
        hinge = rotate_planar(leaf.pose[:2] - way.middle, np.float64(-way.heading))
        assert way.push == trial.name.startswith("push")
        assert (hinge[0] < 0) == trial.name.endswith("right"), "facing -Y, the right hand is towards -X"
        sizes.add(round(leaf.width, 3))
    assert len(sizes) == 4


def test_steps_are_climbed_from_the_near_side_and_walls_across():
    for trial in climbing.trials(3):
        goal = climbing.request(trial).goals[0]
        ahead = heading_to_direction(np.array(goal.heading))
        if trial.piece.kind == "low_wall":
            assert goal.position[2] == 0
            # The place lies beyond the wall for one who comes from the start.
            assert (goal.position[:2] @ ahead) > 0.5 > 0 > trial.start @ ahead
        else:
            assert goal.position[2] == pytest.approx(trial.piece.size[2]) and trial.start @ ahead < 0
        assert abs(wrap_angle(goal.interaction.heading - goal.heading - np.pi)) < 1e-6
        assert goal.interaction.occupancy.max() == 1


def test_held_back_pieces_serve_where_there_are_some():
    pool = pool_of("chair", "table", "box")
    chair = next(e.piece for e in pool.entries if e.piece.kind == "chair")
    seats = sitting.trials(1, pool=pool)
    assert seats[0].known and not seats[1].known
    assert len(seats[0].piece.mins) == len(chair.mins) and seats[0].piece.seat.heading == 0
    hips = sitting.request(seats[0]).goals[0].position
    assert np.allclose(hips[:2], seats[0].piece.seat.point[:2])
    for trial in carrying.trials(1, pool=pool):
        assert max(trial.crate.size[:2]) <= 0.45
        assert box_in_solids(carrying.request(trial).goals[0].prop, trial.box[None], carrying.request(trial).environment) < 2e-3
    assert scaled(chair, np.ones(3)).seat.height == pytest.approx(chair.seat.height)


def test_seats_at_tables_stand_partly_under_them():
    for trial in sitting.trials_at_tables(1):
        table, place, _ = trial.others[0]
        front = place[1] + table.maxs[:, 1].max()
        assert 0.2 < trial.piece.seat.point[1] - front < 0.4
        assert len(sitting.request(trial).environment.groups) == 2


def test_rooms_offer_every_action_and_the_box_goes_somewhere_else():
    room = rooms.make_room(np.random.default_rng(1))
    rng = np.random.default_rng(2)
    before = room.box.pose[:3]
    for _ in range(4):
        goal = rooms.goal_of(room, "carry", rng)
        assert np.linalg.norm(goal.position - before) > 0.5
        assert box_in_solids(room.box, np.append(goal.position, goal.heading)[None], room.query) < 0.02
        before = goal.position
    goals = rooms.random_goals(room, rng, 30)
    assert len({g.action for g in goals}) == 7
    with pytest.raises(GoalError, match="free place"):
        rollout.start_about(rng, np.zeros(2), lambda place: False)


# --- judging ---------------------------------------------------------------------------------------------------


def test_a_door_counts_as_passed_only_through_its_opening():
    trial = doors.trials(1)[0]
    leaf = doors.request(trial).goals[0].prop
    way = passage(leaf, trial.start)
    ahead = heading_to_direction(np.array(way.heading))
    side = np.array((-ahead[1], ahead[0]))
    through = way.middle + np.linspace(-2.01, 0.99, 91)[:, None] * ahead
    assert doors.passed_at(through, way, leaf.width) == pytest.approx(70 / FPS)
    assert np.isnan(doors.passed_at(through[:60], way, leaf.width))
    assert np.isnan(doors.passed_at(through + 1.0 * side, way, leaf.width)), "through the wall"


def test_standing_frozen_needs_both_root_and_pose_to_rest():
    root, local = np.zeros((700, 3)), np.zeros((700, J, 4))
    local[..., 0] = 1
    assert stress.stands_frozen(root, local) and not stress.stands_frozen(root[:590], local[:590])
    nodding = local.copy()
    nodding[::40, 5] = (np.cos(0.05), np.sin(0.05), 0, 0)
    assert not stress.stands_frozen(root, nodding)
    swaying = root.copy()
    swaying[:, 0] = 0.04 * np.sin(np.arange(700) / 50)
    assert not stress.stands_frozen(swaying, local)


def test_jumps_are_told_from_those_of_the_rest():
    rotations = np.zeros((200, J, 4))
    rotations[..., 0] = 1
    hips = np.zeros((200, 3))
    hips[:, 0] = 0.03 * np.arange(200)
    take = TakeResult(hips, rotations, hips, rotations, *(np.zeros((200, n)) for n in (5, 3, 7, 8)), [], {})
    rotations[120:, 5] = (np.cos(0.2), np.sin(0.2), 0, 0)
    assert interruptions.jump_report(take, 119)["popped"] == 1
    assert interruptions.jump_report(take, 119)["there_turn_per_frame_deg"] == pytest.approx(np.degrees(0.4), abs=0.01)
    assert interruptions.jump_report(take, 60)["popped"] == 0


def test_counts_of_random_goals_add_up():
    outcomes = [
        stress.Outcome(0, 50.0, "", False, ["carry"], {"walk": [2, 2], "carry": [1, 0]}, 1500, 30),
        stress.Outcome(1, 70.0, "GoalError: N m", True, [], {"walk": [2, 1]}, 500, 70),
        stress.Outcome(2, 10.0, "GoalError: N m", False),
    ]
    s = stress.summarise(outcomes)
    assert s["seconds"] == 130 and s["not_finite"] == 1 and s["frozen"] == 1 and s["errors"] == {"GoalError: N m": 2}
    assert s["asked_reached"] == {"walk": [4, 3], "carry": [1, 0]} and s["deep_share"] == pytest.approx(0.05)
    assert s["frozen_seeds"] == [0] and s["error_seeds"] == [1, 2]
    text = stress.table(s)
    assert "3 of 4 (75%)" in text and "of these: GoalError: N m | 2" in text
    assert stress.message_of(GoalError("at (1.25, -3) m")) == "GoalError: at (N, N) m"


def test_a_summary_counts_what_broke_off_as_not_reached():
    reports = [{"reached": 1.0, "pe_cm": 2.0, "frames": 100.0, "deep_frames": 5.0, "slide_all_total": 2.0, "slide_all_count": 10.0}] * 3
    s = rollout.summarise([*reports, {"reached": 0.0, "failed": 1.0, "error": "GoalError: no"}])
    assert s["reached"] == 0.75 and s["failed"] == 1 and s["pe_cm_mean"] == 2 and s["deep_share"] == pytest.approx(0.05)
    assert s["slide_all"] == pytest.approx(20) and "error_mean" not in s


def test_tables_print_ours_beside_the_paper_and_the_aim():
    report = {"reached": 1.0, "network_pe_cm": 2.5, "network_re_deg": 1.0, "pe_cm": 0.5, "re_deg": 0.3}
    report |= {"penetration_end_cm": 0.0, "seconds": 5.0}
    broken = {"reached": 0.0, "failed": 1.0, "error": "ValueError: x"}
    result = {
        "sit": sitting.summarise([report, broken]),
        "sit, interaction sensor zeroed": sitting.summarise([report | {"network_pe_cm": 9.0}]),
        "carry": carrying.summarise([broken]),
        "data": {"walk": 9.0, "all": 8.0},
        "trials": [{"part": "carry", "ablation": None, "setting": 0, "name": "x", **broken}],
    }
    text = run.tables(result)
    assert "| sit PE cm, network alone (mean / median) | 2.50 / 2.50 | 2.93 | 2.9 |" in text
    assert "| interaction sensor zeroed at run time, not retrained: PE cm, network alone | 9.00 | 3.72 (retrained) |  |" in text
    assert "end free of penetration | 50% |" in text and "broke off 1 x carry: ValueError: x" in text
    assert "| walk |  | 9.0 | 11.0 |" in text
    assert np.isnan(Figures()["whatever"])


def test_a_blind_network_reads_nothing_of_one_sensor(model):
    seen = []

    class Eye:
        backend, config, metadata = "numpy", model.config, model.metadata

        def predict(self, x, gating):
            seen.append(x)
            return x, gating

    x = np.ones((1, INPUT.size), np.float32)
    for ablation in ABLATIONS:
        network, options = run.without(Eye(), ablation)
        network.predict(x, x)
        assert bool(options) == ablation.startswith("no ")
    assert (x == 1).all() and (seen[0] == 1).all()
    for given, sensor in zip(seen[1:], ("interaction", "environment"), strict=True):
        assert (given[:, INPUT.slices[sensor]] == 0).all() and given.sum() == INPUT.size - (given == 0).sum()
        assert (given == 0).sum() == INPUT.slices[sensor].stop - INPUT.slices[sensor].start


# --- roll-outs on the shipped weights --------------------------------------------------------------------------


def test_figures_of_a_sit_and_of_a_walk_through_a_hole(model):
    _, sit = sitting.run_trial(model, sitting.trials(1)[0])
    summary = sitting.summarise([sit])
    assert summary["success"] == 1 and summary["within_3cm_3deg_ik"] == 1 and sit["network_pe_cm"] < 10
    assert 0 < summary["slide_all"] < 20 and sit["frames"] > 60
    hole = next(t for t in locomotion.trials(1) if t.name == "hole")
    _, walk = locomotion.run_trial(model, hole)
    assert walk["reached"] == 1 and walk["penetration_cm"] < 3 and 0.9 < walk["path_ratio"] < 1.3
    text = run.tables({"sit": summary, "travel": locomotion.summarise([walk])})
    assert "walks through a wall with a hole: reached | 100% |" in text


@pytest.mark.parametrize("part", ["carry", "open", "climb"])
def test_every_line_of_a_part_has_its_figure(model, part):
    trial = PARTS[part].trials(1, None)[0]
    _, report = PARTS[part].run(model, trial, time_limit=1.0)
    summary = PARTS[part].summarise([report])
    missing = []

    class Asked(Figures):
        def __missing__(self, key):
            missing.append(key)
            return float("nan")

    PARTS[part].rows(Asked(summary))
    assert not missing
    json.dumps(run._plain({"summary": summary, "report": report}), allow_nan=False)


def test_an_order_is_answered(model):
    order = locomotion.orders(1)[1]
    take, report = locomotion.run_order(model, order)
    assert order.name == "idle to walk" and 0.1 < report["idle_to_walk_s"] < 2 and report["reached"] == 1
    assert len(take.root) > 3


def test_the_command_runs_parts_and_writes_what_it_printed(tmp_path, capsys):
    with pytest.raises(SystemExit):
        run.main(["--only", "dance"])
    assert "there is no part dance" in capsys.readouterr().err
    assert run.main(["--only", "none", "--out", str(tmp_path / "a" / "e.json")]) == 0
    assert json.loads((tmp_path / "a" / "e.json").read_text()) == {"trials": []}
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="folder"):
        run.write({}, tmp_path / "file" / "x.json")


# --- the data's own slide --------------------------------------------------------------------------------------


def test_the_slide_of_the_data_is_measured_over_what_is_climbed(tmp_path_factory):
    folder = data_folder(tmp_path_factory)
    slide = slide_of_data(folder)
    assert {"idle", "walk", "sit", "all"} <= set(slide) and 0 <= slide["idle"] < slide["walk"] < 60
    assert slide_of_data(folder, most=0.01)["all"] != slide["all"]
    step = furniture.make("step", np.random.default_rng(0), height=0.32, depth=0.8, width=1.0)
    volume = interaction_sensor(furniture.cuboids([(step, np.zeros(2), 0.0)]), step.centre, step.size, 0.0)
    arrays = {
        "object": np.zeros(10, np.int32),
        "object_pose": np.tile(np.array((2.0, 1.0, 0.0, np.pi / 2)), (10, 1)),
        "object_cells": volume.cells_world()[None],
        "object_occupancy": volume.occupancy[None],
    }
    style = np.zeros((10, 7))
    assert _ground(arrays, slice(0, 10), style) is None
    style[:, CLIMB] = 1
    ground = _ground(arrays, slice(0, 10), style)
    places = np.array(((2.0, 1.0), (2.39, 1.49), (2.41, 1.0), (2.0, 1.51), (0, 0)))
    assert np.allclose(ground(places), (0.32, 0.32, 0, 0, 0), atol=1e-5)
