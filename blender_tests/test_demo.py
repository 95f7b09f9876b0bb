"""The demo: its scene, its files, and its start as a plain script."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

from nsm_blender import demo
from nsm_blender.animation.channels import channels_of
from nsm_blender.rigs.armature import read_pose
from nsm_blender.takes import TakeSpec, finish, prepare
from nsm_core.body.skeleton import JOINTS
from nsm_core.control.actions.registry import check_reachable
from nsm_core.world.affordances.passage import passage
from nsm_core.world.planning.floor_plan import FloorPlan

ROOT = Path(__file__).resolve().parents[1]


def test_the_scene_is_ready_for_a_take_and_for_the_eye():
    room, character = demo.build_scene("bench", all_actions=False)
    scene = bpy.context.scene
    start = read_pose(character)
    assert start.position == pytest.approx(room.start, abs=1e-4)
    assert start.heading == pytest.approx(room.start_heading, abs=1e-4)
    assert room.seats == ["Chair", "Bench"] and all(name in scene.objects for name in room.seats)
    assert scene.camera and scene.world and scene.render.fps == 30
    assert len({o.name for o in scene.objects if o.type == "MESH"}) > 15


@pytest.mark.parametrize("all_actions", [True, False])
def test_the_character_does_not_start_in_the_furniture(all_actions):
    room, _ = demo.build_scene(all_actions=all_actions)
    for name in room.objects:
        piece = bpy.data.objects[name]
        corners = np.array([piece.matrix_world @ Vector(c) for c in piece.bound_box])
        if corners[:, 2].max() < 0.03:  # floor and rug
            continue
        gap = np.maximum(
            corners[:, :2].min(0) - room.start, np.array(room.start) - corners[:, :2].max(0)
        ).max()
        assert gap > 0.3, f"{name} is too near"


def test_the_demo_runs_as_a_script_from_anywhere(tmp_path):
    script = [sys.executable, str(ROOT / "nsm_blender" / "demo.py"), "--help"]
    done = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "--out" in done.stdout


def test_an_unwritable_folder_is_one_sentence(tmp_path, capsys):
    (tmp_path / "file").write_text("in the way")
    assert demo.main(["--out", str(tmp_path / "file" / "out")]) == 1
    said = capsys.readouterr().err
    assert "cannot be written" in said and "choose another folder" in said and "Traceback" not in said


def test_the_demo_reaches_all_its_goals_and_leaves_its_files(tmp_path, capsys):
    code = demo.main(["--out", str(tmp_path), "--tiles", "3", "--hold", "0.5", "--no-video"])
    report = json.loads((tmp_path / "demo.json").read_text(encoding="utf-8"))
    assert [goal["object"] for goal in report["goals"]] == ["Chair", "Door", "Box", "Podium", "place"]
    assert code == 0 and all(goal["reached"] for goal in report["goals"]), report["goals"]
    assert (tmp_path / "demo.png").stat().st_size > 10_000
    assert "Done in" in capsys.readouterr().out
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "demo.blend"))
    character = bpy.data.objects["Character"]
    channels = channels_of(character)
    assert channels.action.name == "Demo" and {f.group.name for f in channels.bag.fcurves} == set(JOINTS)
    assert len(channels.bag.fcurves[0].keyframe_points) == report["frames"]


def test_the_room_has_two_seats_and_a_way_to_both():
    """What becomes of a take in it is seen in the house: demo and takes are the same for both."""
    room, character = demo.build_scene(all_actions=False)
    request, _, things = finish(
        prepare(TakeSpec(character, demo.goals_in(room, hold=0.5)), bpy.context.scene)
    )
    assert [(g.action, g.name, g.hold) for g in request.goals] == [
        ("sit", "Chair", 0.5),
        ("sit", "Armchair", 0.5),
    ]
    assert not things and all(0.4 < g.position[2] < 0.7 for g in request.goals)
    places = np.array([request.start_position, *[g.position[:2] for g in request.goals]])
    plan = FloorPlan(request.environment, (places.min(0) - 4, places.max(0) + 4))
    check_reachable(request.goals, plan, request.start_position)


def test_the_house_has_a_place_for_every_action_and_ways_between_them():
    house, character = demo.build_scene()
    scene = bpy.context.scene
    specs = demo.goals_in(house, hold=0.5)
    assert [s.action for s in specs] == ["sit", "open", "carry", "climb", "run"] and specs[0].hold == 0.5
    assert {s.object.name for s in specs if s.object} | {"Sideboard"} <= set(house.objects)
    request, frame, things = finish(prepare(TakeSpec(character, specs), scene))
    _, open_, carry, climb, _ = request.goals
    assert set(things) == {"Door", "Box"}
    leaf = open_.prop
    # The hinge is found.
    np.testing.assert_allclose(leaf.pose[:2], bpy.data.objects["Door"].location[:2], atol=1e-4)
    assert leaf.width == pytest.approx(0.86, abs=0.02) and leaf.handle[2] == pytest.approx(1.02, abs=0.02)
    way = passage(leaf, request.goals[0].position[:2])
    assert way.push and way.heading == pytest.approx(np.pi / 2, abs=1e-5)
    assert carry.position[2] == pytest.approx(0.82 + 0.125, abs=0.01) and climb.position[2] == pytest.approx(
        0.3, abs=0.01
    )
    places = np.array([request.start_position, *[g.position[:2] for g in request.goals]])
    check_reachable(
        request.goals,
        FloorPlan(request.environment, (places.min(0) - 4, places.max(0) + 4)),
        request.start_position,
    )
    # Opened wide, the leaf meets no furniture and no wall but at its hinge.
    door = things["Door"]
    corners = np.array([c for c in bpy.data.objects["Door"].bound_box if c[0] > 0.3])
    for angle in (0.4, 1.0, 1.5):
        matrix = np.array(door.world_at(leaf.pose_at(angle)))
        points = corners @ matrix[:3, :3].T + matrix[:3, 3]
        assert request.environment.signed_distance(points.astype(np.float32), 0.05).min() > 0.01
