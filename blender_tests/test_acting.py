"""Whole takes with things on the shipped network: what is carried, opened, climbed and run, in the scene and
in its keys.
"""

from __future__ import annotations

import json
import math

import bpy
import numpy as np
import pytest
from modal import Modal, Window
from scenes import box, door, furnish, mesh_of_boxes

import nsm_blender
from nsm_blender import batch
from nsm_blender.goals.open import read_leaf
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import read_back
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import Take, TakeSpec, finish, generate
from nsm_blender.ui import running
from nsm_blender.world.surroundings import Surroundings
from nsm_core.body.skeleton import ARMS, FEET, forward_kinematics
from nsm_core.world.affordances.passage import passage
from nsm_core.world.scene.props import Leaf

BOX = (0.4, 0.3, 0.25)


def crate(location=(0.0, 0.2, 0.0), turn=0.2):
    return mesh_of_boxes("Box", [((-0.2, -0.15, 0), (0.2, 0.15, 0.25))], location, turn)


def act(character, *goals: GoalSpec, **options) -> Take:
    bpy.context.scene.render.fps = 30
    take = finish(generate(TakeSpec(character, list(goals), **options), bpy.context.scene))
    assert all(goal["reached"] for goal in take.report["goals"]), take.report
    return take


def joints(character, *frames: int) -> np.ndarray:
    """World positions (N, 23, 3) that the keys give the joints."""
    return forward_kinematics(*read_back(character, frames))[0]


def world(target: bpy.types.Object, frame: int) -> np.ndarray:
    """World matrix that the keys give an object."""
    bpy.context.scene.frame_set(frame)
    return np.array(target.matrix_world)


class TestCarry:
    def test_a_box_from_the_floor_comes_to_stand_on_the_table(self):
        character, target = add_character((0.0, 1.6, 0.0)), crate()
        table = box("Table", (1.3, -1.6, 0), (2.1, -0.4, 0.7))
        bpy.context.view_layer.update()
        before = np.array(target.matrix_world)
        take = act(character, GoalSpec("carry", target, hold=0.3, to=table))
        (keyed,) = take.keyed.things
        action = target.animation_data.action
        assert keyed.object == target and keyed.action == action != character.animation_data.action
        assert action.frame_range[:] == pytest.approx((take.keyed.frame_start, take.keyed.frame_end))
        np.testing.assert_allclose(world(target, take.keyed.frame_start), before, atol=1e-5)
        end = world(target, take.keyed.frame_end)
        np.testing.assert_allclose(end[:3, 2], (0, 0, 1), atol=1e-5)  # right side up
        assert end[2, 3] == pytest.approx(0.7, abs=0.03)
        corners = np.array(target.bound_box) @ end[:3, :3].T + end[:3, 3]
        assert (corners[:, :2] > (1.29, -1.61)).all() and (corners[:, :2] < (2.11, -0.39)).all()
        # While it is in the air both wrists are at it, and it keeps its distance from the body.
        flying = [
            f
            for f in range(take.keyed.frame_start, take.keyed.frame_end, 10)
            if world(target, f)[2, 3] > 0.72
        ]
        assert len(flying) > 4
        for frame, body in zip(flying, joints(character, *flying), strict=True):
            middle = world(target, frame) @ (0, 0, BOX[2] / 2, 1)
            reach = np.linalg.norm(body[[arm[2] for arm in ARMS]] - middle[:3], axis=1)
            assert (reach < 0.36).all(), frame
            assert np.linalg.norm(body[0, :2] - middle[:2]) > 0.3, frame
        assert joints(character, take.keyed.frame_end)[0, 0, 2] > 0.85  # stands upright again

    def test_escape_puts_the_box_back(self):
        nsm_blender.register()
        try:
            scene, target = bpy.context.scene, crate()
            table = box("Table", (1.3, -1.6, 0), (2.1, -0.4, 0.7))
            scene.nsm.character = add_character((0.0, 1.2, 0.0))
            row = scene.nsm.goals.add()
            row.action, row.object, row.destination = "carry", target, table
            bpy.context.view_layer.update()
            before, modal = np.array(target.matrix_world), Modal(Window(scene))
            modal._start(modal.window)
            while target.matrix_world.translation.z < 0.2:
                assert modal.event("TIMER") == {"RUNNING_MODAL"}
                bpy.context.view_layer.update()
            assert modal.event("ESC") == {"CANCELLED"}
            bpy.context.view_layer.update()
            np.testing.assert_array_equal(np.array(target.matrix_world), before)
            assert not bpy.data.actions and target.animation_data is None and running.current() is None
        finally:
            nsm_blender.unregister()


class TestOpen:
    @pytest.mark.parametrize(("push", "side"), [(True, -1.0), (False, 1.0)])
    def test_a_door_is_opened_and_passed(self, push, side):
        leaf = door()
        character = add_character((0.4, side * 1.4, 0.0))
        character.rotation_euler.z = 0.0 if side > 0 else math.pi
        take = act(character, GoalSpec("open", leaf, hold=0.3))
        assert leaf.animation_data.action == take.keyed.things[0].action != character.animation_data.action
        frames = range(take.keyed.frame_start, take.keyed.frame_end + 1, 3)
        turned = [math.atan2(m[1, 0], m[0, 0]) for m in (world(leaf, f) for f in frames)]
        # It opens towards its +Y.
        assert turned[0] == pytest.approx(0.0, abs=1e-4) and turned[-1] > math.radians(60)
        assert np.abs(np.diff(turned)).max() < 0.5  # it swings, it does not jump
        end = world(leaf, take.keyed.frame_end)
        np.testing.assert_allclose(end[:3, 3], 0, atol=1e-4)  # about its hinge
        hips = joints(character, take.keyed.frame_end)[0, 0]
        assert -side * hips[1] > 0.6 and 0.0 < hips[0] < 0.86
        assert passage(closed_leaf(take), np.array((0.4, side * 1.4))).push is push
        # Some hand is at the handle while the leaf starts to move.
        moving = frames[int(np.argmax(np.abs(turned) > 0.15))]
        handle = world(leaf, moving) @ (0.78, 0, 1.015, 1)
        wrists = joints(character, moving)[0][[arm[2] for arm in ARMS]]
        assert np.linalg.norm(wrists - handle[:3], axis=1).min() < 0.25


def closed_leaf(take: Take) -> Leaf:
    """The leaf that a take opens, as it was before."""
    target = take.keyed.things[0].object
    bpy.context.scene.frame_set(take.keyed.frame_start)
    return read_leaf(
        target, None, None, Surroundings(bpy.context.scene, take.frame, take.keyed.armature, [target])
    )


def test_a_step_is_climbed():
    character, step = add_character((0.0, 1.3, 0.0)), box("Step", (-0.6, -0.9, 0), (0.6, 0.1, 0.3))
    take = act(character, GoalSpec("climb", step, hold=0.3))
    before, after = joints(character, take.keyed.frame_start, take.keyed.frame_end)
    ankles = [leg[2] for leg in FEET]
    np.testing.assert_allclose(after[ankles, 2] - before[ankles, 2], 0.3, atol=0.05)
    assert (
        (np.abs(after[ankles, 0]) < 0.5).all()
        and (after[ankles, 1] > -0.85).all()
        and (after[ankles, 1] < 0.05).all()
    )
    assert after[0, 2] - before[0, 2] == pytest.approx(0.3, abs=0.06)


def test_running_to_a_place():
    character = add_character()
    take = act(character, GoalSpec("run", location=(0.5, -4.5, 0.0), hold=0.3))
    assert take.report["top_speed_m_s"] > 2.2
    np.testing.assert_allclose(joints(character, take.keyed.frame_end)[0, 0, :2], (0.5, -4.5), atol=0.12)


def test_a_job_with_goals_of_every_form(tmp_path):
    add_character((0.4, 1.3, 0.0))
    door()
    crate((0.5, -1.9, 0.0), 0.0)
    box("Table", (1.6, -2.8, 0), (2.4, -1.6, 0.6))
    furnish("chair", "Chair", (-1.6, -1.6), math.pi / 2)
    bpy.context.scene.render.fps = 30
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    (tmp_path / "job.toml").write_text(
        """
        scene = "room.blend"
        [[take]]
        name = "all"
        out = "all.blend"
        report = "all.json"
        goals = [
            { object = "Door", action = "open", hold = 0.1 },
            { object = "Box", action = "carry", to = "Table", hold = 0.1 },
            { location = [0.4, -2.4, 0], action = "walk", hold = 0.1 },
            { action = "idle", hold = 0.2 },
            { object = "Chair", action = "sit", hold = 0.2 },
        ]
        """
    )
    lines: list[str] = []
    assert batch.main([str(tmp_path / "job.toml")], lines.append) == 0, lines
    report = json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))
    assert [g["action"] for g in report["goals"]] == ["open", "carry", "walk", "idle", "sit"]
    assert all(g["reached"] for g in report["goals"]), report
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "all.blend"))
    actions = {
        name: bpy.data.objects[name].animation_data.action.name for name in ("Character", "Door", "Box")
    }
    assert len(set(actions.values())) == 3 and bpy.data.objects["Table"].animation_data is None
    end = world(bpy.data.objects["Box"], bpy.context.scene.frame_end)
    assert end[2, 3] == pytest.approx(0.6, abs=0.03)


def test_one_undo_takes_the_whole_take_back():
    nsm_blender.register()
    try:
        leaf, settings = door(), bpy.context.scene.nsm
        settings.character = add_character((0.4, -1.3, 0.0))
        settings.character.rotation_euler.z = math.pi
        row = settings.goals.add()
        row.action, row.object, row.hold = "open", leaf, 0.1
        bpy.ops.ed.undo_push(message="before")
        assert bpy.ops.nsm.generate("EXEC_DEFAULT", True) == {"FINISHED"}
        assert len(bpy.data.actions) == 2 and bpy.data.objects["Door"].animation_data.action is not None
        if bpy.ops.ed.undo() != {"FINISHED"}:
            pytest.skip("this build keeps no undo steps without a window")
        for name in ("Door", "Character"):
            data = bpy.data.objects[name].animation_data
            assert data is None or data.action is None
        np.testing.assert_allclose(np.array(bpy.data.objects["Door"].matrix_world), np.eye(4), atol=1e-6)
        assert len(bpy.context.scene.nsm.goals) == 1  # not more than the take
    finally:
        nsm_blender.unregister()
