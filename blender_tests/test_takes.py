"""Takes on the shipped network: a seat that was not in training, and a scene that keeps all it had."""

from __future__ import annotations

import copy
import math

import bpy
import numpy as np
import pytest
from modal import Modal, Window
from scenes import box, furnish

import nsm_blender
from nsm_blender.animation.channels import transform_of
from nsm_blender.animation.kept import SceneState
from nsm_blender.goals.resolve import show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import read_back
from nsm_blender.keys.report import result_lines
from nsm_blender.prepare import TakeSpec, own_objects, prepare, start_of
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import finish, generate, shipped_model
from nsm_blender.ui import running
from nsm_blender.ui.session import TakeSession
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.skeleton import HIP_OVER_SEAT, HIPS, forward_kinematics, root_of
from nsm_core.rotations import wrap_angle

AWAY = (0.4, -2.3)


def room(kind: str = "chair", at: tuple[float, float] = AWAY, heading: float = 0.5, **where):
    """A character and a seat from a seed that training never draws; ``where`` may move, turn and scale the
    character.
    """
    character = add_character(where.get("location", (0.0, 0.0, 0.0)))
    character.rotation_euler.z = where.get("turn", 0.0)
    character.scale = (where.get("scale", 1.0),) * 3
    seat, piece = furnish(kind, "Seat", at, heading)
    bpy.context.scene.render.fps = 30
    return character, seat, piece


def sit_on(character, seat, **options) -> TakeSpec:
    return TakeSpec(character, [GoalSpec("sit", seat, hold=0.5)], **options)


def step_aside(character, **options) -> TakeSpec:
    return TakeSpec(character, [GoalSpec("walk", None, hold=0.2, location=(0.9, 0.0, 0.0))], **options)


def everything(scene: bpy.types.Scene, character: bpy.types.Object):
    """All that a cancelled take must leave alone, in values that can be compared."""
    pose = {
        b.name: tuple(map(tuple, b.matrix_basis)) + tuple(b.rotation_quaternion) + tuple(b.location)
        for b in character.pose.bones
    }
    data = character.animation_data
    counts = {
        kind: len(getattr(bpy.data, kind))
        for kind in ("objects", "meshes", "actions", "armatures", "materials", "collections")
    }
    action = (
        (data.action.name, data.action.users, data.action.use_fake_user) if data and data.action else None
    )
    return (
        pose,
        counts,
        action,
        scene.frame_current,
        scene.frame_subframe,
        tuple(o.name for o in bpy.context.selected_objects),
    )


def old_action(character: bpy.types.Object) -> bpy.types.Action:
    """Give the character an action that moves its hips, as an animator would."""
    hips = character.pose.bones["Hips"]
    for frame, x in ((1, 0.0), (50, 1.0)):
        hips.location.x = x
        hips.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)
    return character.animation_data.action


def test_the_report_tells_that_the_network_learned_other_distances():
    character = add_character((0.0, 0.0, 0.0))
    model = copy.copy(shipped_model())
    model.metadata = {**model.metadata, "meaning": {"distances": {"PULL_BACK": 0.5}}}
    take = finish(generate(step_aside(character), bpy.context.scene, model))
    (warning,) = take.report["warnings"]
    assert "PULL_BACK 0.5 m where this version has 0.55 m" in warning
    assert (warning, False) in result_lines(take.report)


class TestBeforeTheNetwork:
    def test_start_is_where_the_character_stands(self):
        character, _, _ = room(location=(1.0, -2.0, 0.3), turn=0.9, scale=0.5)
        bpy.context.view_layer.update()
        frame, (position, heading) = start_of(character, bpy.context.scene)
        assert frame.scale == pytest.approx(0.5) and frame.floor == pytest.approx(0.3)
        np.testing.assert_allclose(position, (2.0, -4.0), atol=1e-4)
        assert heading == pytest.approx(0.9, abs=1e-4)

    def test_start_is_the_pose_at_the_start_frame_and_the_frame_comes_back(self):
        character, seat, _ = room()
        old_action(character)
        scene = bpy.context.scene
        scene.frame_set(7)
        here = read_back(character, [50])[0][0]
        before = everything(scene, character)
        request, _, _ = finish(prepare(sit_on(character, seat, start_frame=50), scene))
        np.testing.assert_allclose(request.start_position, here[:2], atol=1e-4)
        assert everything(scene, character) == before

    def test_environment_holds_the_room_but_not_the_character(self):
        character, seat, _ = room(at=(0.0, -4.0))
        box("Table", (1.0, -0.5, 0.0), (2.0, 0.5, 0.8))
        request, _, _ = finish(prepare(sit_on(character, seat), bpy.context.scene))
        inside_table, inside_body, free = request.environment.signed_distance(
            np.array(((1.5, 0, 0.4), (0, 0, 1.2), (-1.5, 0, 0.4)), np.float32), 0.3
        )
        assert inside_table < 0 and inside_body == free == pytest.approx(0.3)

    def test_environment_of_a_scaled_character_is_in_its_own_units(self):
        character, seat, _ = room(at=(0.0, -4.0), scale=2.0)
        show = GoalSpec("walk", None, location=(0.0, -1.0, 0.0))
        box("Table", (1.0, -0.5, 0.0), (2.0, 0.5, 0.8))
        request, frame, _ = finish(prepare(TakeSpec(character, [show]), bpy.context.scene))
        near = request.environment.signed_distance(np.array(((0.4, 0, 0.2),), np.float32), 0.3)
        assert near[0] == pytest.approx(0.1, abs=1e-3)  # 0.2 m in the scene
        np.testing.assert_allclose(request.goals[0].position, (0, -0.5, 0), atol=1e-6)
        np.testing.assert_allclose(frame.to_world(request.goals[0].position), (0, -1, 0), atol=1e-6)

    def test_goals_start_where_the_one_before_ended(self):
        character, seat, _ = room()
        goals = [
            GoalSpec("walk", None, location=(2.0, 0.0, 0.0)),
            GoalSpec("walk", None, location=(2.0, 2.0, 0.0)),
            GoalSpec("idle"),
        ]
        request, _, _ = finish(prepare(TakeSpec(character, goals), bpy.context.scene))
        assert [round(g.heading, 3) for g in request.goals] == [
            round(math.pi / 2, 3),
            round(math.pi, 3),
            round(math.pi, 3),
        ]
        np.testing.assert_allclose(request.goals[2].position, (2, 2, 0), atol=1e-6)

    def test_own_objects_are_armature_body_and_clothes(self):
        character, seat, _ = room()
        shirt = box("Shirt", (0, 0, 0), (1, 1, 1))
        shirt.modifiers.new("Armature", "ARMATURE").object = character
        own = {o.name for o in own_objects(character, bpy.context.scene)}
        assert {character.name, "Shirt"} <= own and "Seat" not in own

    def test_scene_state_restores_every_channel_exactly(self):
        character, _, _ = room()
        scene = bpy.context.scene
        bone = character.pose.bones["LeftKnee"]
        bone.rotation_mode, bone.rotation_euler, bone.scale = "XYZ", (0.1, 0.2, 0.3), (1, 1.1, 1)
        bpy.context.view_layer.update()
        before, state = everything(scene, character), SceneState(scene, character)
        bone.rotation_euler, bone.location = (1, 1, 1), (0, 0, 1)
        scene.frame_set(20)
        assert everything(scene, character) != before
        state.restore()
        assert everything(scene, character) == before


class TestOnTheNetwork:
    @pytest.mark.parametrize(
        ("kind", "where"),
        [("armchair", {"location": (-0.8, 0.5, 0.0), "turn": 2.0}), ("stool", {"turn": -1.2})],
    )
    def test_reaches_a_seat_that_was_not_in_training(self, kind, where):
        character, seat, piece = room(kind, **where)
        scene = bpy.context.scene
        take = finish(generate(sit_on(character, seat), scene))
        (goal,) = take.report["goals"]
        assert goal["reached"], take.report
        assert goal["position_error_cm"] < 5 and goal["rotation_error_deg"] < 5, goal
        assert take.report["planted_share"] > 0.4 and take.report["top_speed_m_s"] < 2.5
        positions, _ = forward_kinematics(take.result.hips_position[-1], take.result.local_rotations[-1])
        assert abs(math.degrees(wrap_angle(float(root_of(positions)[1]) - (piece.seat.heading + 0.5)))) < 15
        # What the report says is what the keys do, at the end of the hold.
        hips, local = read_back(character, [take.keyed.frame_end])
        positions, _ = forward_kinematics(hips, local)
        point = show_goal_point(
            GoalSpec("sit", seat), scene, WorldFrame(), (np.zeros(2), 0.0)
        ).matrix_world.translation
        assert np.linalg.norm(positions[0, HIPS] - (np.array(point) + (0, 0, HIP_OVER_SEAT))) < 0.08

    def test_keys_become_a_new_action_and_the_old_one_stays(self):
        character, seat, _ = room()
        scene, old = bpy.context.scene, old_action(character)
        scene.frame_set(3)
        take = finish(generate(step_aside(character, name="Step aside"), scene))
        action = character.animation_data.action
        assert action.name == "Step aside" and old.name in bpy.data.actions and old.use_fake_user
        assert action.frame_range[0] == take.keyed.frame_start == 1
        assert action.frame_range[1] == take.keyed.frame_end == take.report["frames"]
        assert scene.frame_current == 3

    def test_a_scaled_turned_and_raised_character_does_the_same_in_its_size(self):
        character, seat, piece = room(
            location=(1.0, 0.0, 0.5), scale=0.6, at=(1.0 + 0.6 * AWAY[0], 0.6 * AWAY[1])
        )
        seat.scale, seat.location.z = (0.6,) * 3, 0.5
        scene = bpy.context.scene
        take = finish(generate(sit_on(character, seat), scene))
        assert take.report["goals"][0]["reached"]
        hips, local = read_back(character, [take.keyed.frame_end])
        end = np.array(seat.matrix_world) @ np.append(piece.seat.point + (0, 0, HIP_OVER_SEAT), 1)
        assert np.linalg.norm(hips[0] - end[:3]) < 0.08

    def test_two_goals_in_their_order(self):
        character, seat, _ = room()
        scene = bpy.context.scene
        goals = [GoalSpec("walk", None, hold=0.5, location=(1.5, 0.5, 0.0)), GoalSpec("sit", seat, hold=0.5)]
        take = finish(generate(TakeSpec(character, goals), scene))
        assert [(g["object"], g["action"], g["reached"]) for g in take.report["goals"]] == [
            ("place", "walk", True),
            ("Seat", "sit", True),
        ]
        assert len(result_lines(take.report)) == 3

    def test_cancelling_leaves_no_trace(self):
        character, seat, _ = room()
        scene, old = bpy.context.scene, old_action(character)
        scene.frame_set(30)
        character.pose.bones["Chest"].location = (0, 0.1, 0)  # not keyed
        bpy.context.view_layer.update()
        before = everything(scene, character)
        session = TakeSession(sit_on(character, seat, start_frame=1), scene)
        shown = set()
        while session.fraction < 0.1 or not session.text.startswith("Generating"):
            assert session.tick(0.03) is None
            bpy.context.view_layer.update()
            shown.add(tuple(character.pose.bones["Hips"].head))
        assert len(shown) > 2  # the viewport shows the motion growing
        assert running.current() is not None and 0 < session.fraction < 1
        session.cancel()
        assert running.current() is None
        assert everything(scene, character) == before and character.animation_data.action == old

    def test_the_scene_is_drawn_anew_only_where_it_has_changed(self):
        character, _, _ = room()

        def pose():
            return [transform_of(bone) for bone in character.pose.bones]

        session, before = TakeSession(step_aside(character), bpy.context.scene), pose()
        while not session.posed:
            assert pose() == before and session.tick(0.02) is None
        assert pose() != before
        session.cancel()
        bpy.context.view_layer.update()
        evaluations: list[object] = []
        bpy.app.handlers.depsgraph_update_post.append(lambda *_: evaluations.append(1))
        try:
            SceneState(bpy.context.scene, character, [character]).restore(always=True)  # nothing differs
            bpy.context.view_layer.update()
            assert not evaluations
            character.location.x += 1
            bpy.context.view_layer.update()
            assert evaluations
        finally:
            bpy.app.handlers.depsgraph_update_post.pop()

    def test_a_session_ends_with_the_take_of_a_straight_run(self):
        character, seat, _ = room()
        session, take = TakeSession(step_aside(character), bpy.context.scene), None
        while take is None:
            take = session.tick(0.2)
        assert running.current() is None
        assert character.animation_data.action == take.keyed.action
        # Not the preview's.
        turns = [values["rotation_quaternion"] for _, values in take.keyed.previous_pose]
        assert np.allclose(turns, [(1, 0, 0, 0)] * len(turns), atol=1e-6)

    def test_sidebar_operator_reviews_its_take(self):
        nsm_blender.register()
        try:
            character, seat, _ = room()
            old = old_action(character)
            settings = bpy.context.scene.nsm
            settings.character = character
            row = settings.goals.add()
            row.action, row.location, row.hold = "walk", (0.9, 0.0, 0.0), 0.2
            assert bpy.ops.nsm.generate() == {"FINISHED"}
            assert any("place: arrived" in line.text and "cm" in line.text for line in settings.results)
            assert bpy.ops.nsm.take_reject.poll()
            made = character.animation_data.action.name
            assert bpy.ops.nsm.take_reject() == {"FINISHED"}
            assert character.animation_data.action == old and made not in bpy.data.actions
            assert not bpy.ops.nsm.take_accept.poll()
            bpy.ops.nsm.generate()
            made = character.animation_data.action.name
            assert bpy.ops.nsm.take_accept() == {"FINISHED"}
            assert character.animation_data.action.name == made and len(settings.results) == 0
            assert old.name in bpy.data.actions
        finally:
            nsm_blender.unregister()


@pytest.fixture
def modal():
    nsm_blender.register()
    character, seat, _ = room()
    settings = bpy.context.scene.nsm
    settings.character = character
    row = settings.goals.add()
    row.action, row.location, row.hold = "walk", (0.9, 0.0, 0.0), 0.2
    modal = Modal(Window(bpy.context.scene))
    yield modal
    assert running.current() is None and modal.window.timers == 0 and modal.window.status is None
    nsm_blender.unregister()


class TestModalOperator:
    def test_escape_restores_everything(self, modal):
        scene = bpy.context.scene
        before = everything(scene, scene.nsm.character)
        assert modal._start(modal.window) == {"RUNNING_MODAL"}
        while running.current().fraction < 0.1:
            assert modal.event("TIMER") == {"RUNNING_MODAL"}
        assert "ESC" in modal.window.status and "%" in modal.window.status
        assert not bpy.ops.nsm.generate.poll()  # one at a time
        assert modal.event("WHEELUPMOUSE") == {"PASS_THROUGH"} and modal.event("LEFTMOUSE") == {
            "RUNNING_MODAL"
        }
        assert modal.event("ESC") == {"CANCELLED"}
        assert everything(scene, scene.nsm.character) == before

    def test_it_runs_to_the_end(self, modal):
        modal._start(modal.window)
        while (state := modal.event("TIMER")) == {"RUNNING_MODAL"}:
            pass
        assert state == {"FINISHED"}
        assert bpy.context.scene.nsm.character.animation_data.action is not None
        assert any("place" in text for _, text in modal.reports)

    def test_an_error_on_the_way_restores_and_says_why(self, modal):
        scene = bpy.context.scene
        for name, low, high in (
            ("North", (-4, 2, 0), (4, 2.1, 2)), ("South", (-4, -2.1, 0), (4, -2, 2)),
            ("West", (-4, -2, 0), (-3.9, 2, 2)), ("East", (3.9, -2, 0), (4, 2, 2)),
        ):  # fmt: skip
            box(name, low, high)
        bpy.data.objects["Seat"].location.y = -8
        scene.nsm.goals[0].location = (0.0, -6.0, 0.0)
        before = everything(scene, scene.nsm.character)
        modal._start(modal.window)
        while (state := modal.event("TIMER")) == {"RUNNING_MODAL"}:
            pass
        assert state == {"CANCELLED"}
        assert modal.reports[-1][0] == {"ERROR"} and "no free way" in modal.reports[-1][1]
        assert everything(scene, scene.nsm.character) == before
        assert not scene.nsm.results[0].good
