"""Takes that go on from what the character does at their first frame, and keep what was before."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scenes import box, empty, furnish

import nsm_blender
from nsm_blender.animation.channels import curves_in
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import read_back
from nsm_blender.prepare import TakeSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import Take, finish, generate
from nsm_blender.ui.properties import queue_of
from nsm_core.body.skeleton import INDEX, forward_kinematics
from nsm_core.errors import GoalError

FPS = 24


@pytest.fixture(scope="module", autouse=True)
def addon():
    nsm_blender.register()
    yield
    nsm_blender.unregister()


@pytest.fixture
def room():
    """A character and two seats, at 24 frames a second."""
    character = add_character((0.0, 0.0, 0.0))
    chair, _ = furnish("chair", "Chair", (0.0, -1.6), 0.3)
    stool, _ = furnish("stool", "Stool", (1.6, -1.2), 0.0, seed=90005)
    bpy.context.scene.render.fps = FPS
    return character, chair, stool


def make(character, action, target=None, **more) -> Take:
    goals = [GoalSpec(action, target, hold=0.3, location=more.pop("location", None))]
    return finish(generate(TakeSpec(character, goals, **more), bpy.context.scene))


def joints(character, frames) -> np.ndarray:
    hips, local = read_back(character, frames)
    return forward_kinematics(hips, local)[0]


def most_bent(path: np.ndarray) -> float:
    """The largest acceleration of a joint, m/s2."""
    return float(np.linalg.norm(np.diff(path, n=2, axis=0), axis=-1).max() * FPS**2)


def test_a_sitter_goes_on_from_its_seat_and_sits_down_elsewhere(room):
    character, chair, stool = room
    first = make(character, "sit", chair, start_frame=-20)
    end = first.keyed.frame_end
    before = joints(character, range(-20, end + 1))
    second = make(character, "sit", stool, start_frame=end, begin="pose")
    assert second.report["goals"][0]["reached"] and second.report["goals"][0]["position_error_cm"] < 3
    assert second.keyed.previous_action == first.keyed.action
    after = joints(character, range(-20, second.keyed.frame_end + 1))
    # What was before is there to a tenth of a millimetre, and nothing jumps where the take begins.
    assert np.abs(after[: len(before)] - before).max() < 1e-4
    seam = len(before) - 1
    assert most_bent(after[seam - 5 : seam + 10]) < 45
    # It sat, and does so for the first half second.
    assert np.abs(after[seam : seam + 8, 0] - after[seam, 0]).max() < 0.02


def test_another_goal_in_the_middle_of_a_walk_keeps_what_was_before(room):
    character, _, stool = room
    first = make(character, "walk", location=(-2.5, -2.5, 0.0))
    middle = round(first.keyed.frame_end / 2)
    before = joints(character, range(1, middle + 1))
    assert np.linalg.norm(before[-1, 0] - before[-5, 0]) > 0.1  # it walks there
    second = make(character, "sit", stool, start_frame=middle, begin="pose")
    assert second.report["goals"][0]["reached"]
    after = joints(character, range(1, second.keyed.frame_end + 1))
    assert np.abs(after[:middle] - before).max() < 1e-4
    assert most_bent(after[middle - 6 : middle + 12]) < 50
    # Speed goes through the seam.
    step = np.linalg.norm(np.diff(after[middle - 5 : middle + 4, 0, :2], axis=0), axis=1)
    assert step.min() > 0.5 * step.max()


def test_keys_made_by_hand_are_gone_on_from_and_kept(room):
    character, _, _ = room
    bone = character.pose.bones["RightShoulder"]
    bone.rotation_mode = "QUATERNION"
    for frame, turn in ((1, (1, 0, 0, 0)), (20, (0.8, 0.0, 0.6, 0.0)), (60, (1, 0, 0, 0))):
        bone.rotation_quaternion = turn
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    hand = character.pose.bones["LeftWrist"]
    hand["grip"] = 0.0
    for frame, value in ((1, 0.0), (80, 1.0)):
        hand["grip"] = value
        hand.keyframe_insert('["grip"]', frame=frame)
    old = character.animation_data.action
    before = joints(character, range(1, 41))
    take = make(character, "walk", location=(-1.5, -1.5, 0.0), start_frame=40, begin="pose")
    assert take.report["goals"][0]["reached"]
    after = joints(character, range(1, 60))
    assert np.abs(after[:40] - before).max() < 1e-3
    assert most_bent(after[35:55]) < 60
    grip = [c for c in curves_in(take.keyed.action, take.keyed.slot) if "grip" in c.data_path]
    assert len(grip) == 1 and grip[0].evaluate(80) == pytest.approx(1.0)
    assert old.use_fake_user and len(list(curves_in(old, take.keyed.previous_slot))) == 5


def test_a_character_in_its_rest_pose_begins_with_a_stand(room):
    character, _, _ = room
    take = make(character, "walk", location=(-1.5, -1.0, 0.0), begin="pose")
    wrist = joints(character, [1])[0, INDEX["RightWrist"]]
    assert wrist[2] < 1.1  # the arms of a T-pose are at 1.4
    again = make(character, "walk", location=(-1.5, -1.0, 0.0), begin="pose")
    # Over and over: not from the pose that the first one began with.
    assert np.array_equal(take.result.hips_position, again.result.hips_position)
    character.location.x += 1.0
    aside = make(character, "walk", location=(-0.5, -1.0, 0.0), begin="pose")
    moved = aside.result.hips_position[0] - take.result.hips_position[0]
    assert np.abs(moved - (1.0, 0.0, 0.0)).max() < 0.01


def test_a_box_keeps_what_was_keyed_of_it_before(room):
    character, _, _ = room
    crate = box("Crate", (-1.2, -1.2, 0.0), (-0.9, -0.9, 0.3))
    first = finish(
        generate(
            TakeSpec(character, [GoalSpec("carry", crate, 0.3, to=empty("There", (0.5, -1.0, 0.15)))]),
            bpy.context.scene,
        )
    )
    assert first.report["goals"][0]["reached"]
    end = first.keyed.frame_end
    scene = bpy.context.scene

    def track() -> np.ndarray:
        places = []
        for frame in range(1, end + 1, 6):
            scene.frame_set(frame)
            places.append(np.array(crate.matrix_world.translation))
        return np.array(places)

    before = track()
    goal = GoalSpec("carry", crate, 0.3, to=empty("Back", (-1.2, -0.4, 0.15)))
    second = finish(generate(TakeSpec(character, [goal], start_frame=end, begin="pose"), scene))
    assert second.report["goals"][0]["reached"]
    assert np.abs(track() - before).max() < 1e-4
    # Cut short where the box was not yet taken, it stays where it was; on the way nobody can go on.
    held = 1 + 6 * int(np.flatnonzero(np.abs(np.diff(before, axis=0)).max(1) > 1e-3)[0])
    walk = [GoalSpec("walk", None, 0.2, location=(1.5, -1.5, 0.0))]
    with pytest.raises(GoalError, match="Crate is being moved"):
        finish(generate(TakeSpec(character, walk, start_frame=held + 14, begin="pose"), scene))
    spec, plays = TakeSpec(character, walk, start_frame=held - 12, begin="pose"), crate.animation_data.action
    steps = generate(spec, scene)
    while next(steps).stage != "Checking":
        pass
    assert crate.animation_data.action != plays
    steps.close()  # broken off
    assert crate.animation_data.action == plays and np.abs(track() - before).max() < 1e-4
    third = finish(generate(spec, scene))
    assert [thing.object for thing in third.keyed.things] == [crate]
    assert np.abs(track() - before[0]).max() < 1e-4
    discard_take(third.keyed)
    assert np.abs(track() - before).max() < 1e-4


def test_continue_from_here_appends_at_the_current_frame(room):
    character, chair, _ = room
    scene = bpy.context.scene
    scene.nsm.character = character
    row = queue_of(scene).goals.add()
    row.object, row.action, row.hold = chair, "sit", 0.2
    assert bpy.ops.nsm.generate() == {"FINISHED"}
    first = character.animation_data.action
    scene.frame_set(round(first.frame_range[1]))
    row.action, row.object, row.location = "walk", None, (-1.5, -2.5, 0.0)
    hips = joints(character, [scene.frame_current])[0, 0]
    assert bpy.ops.nsm.continue_take() == {"FINISHED"}
    second = character.animation_data.action
    assert second != first and first.use_fake_user
    assert second.frame_range[0] == first.frame_range[0] and second.frame_range[1] > first.frame_range[1] + 20
    assert np.abs(joints(character, [scene.frame_current])[0, 0] - hips).max() < 1e-4


def test_frames_may_be_fractional_and_rates_have_a_base(room):
    character, _, _ = room
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.001
    take = make(character, "walk", location=(-1.5, -1.0, 0.0), start_frame=-7.5)
    assert take.report["goals"][0]["reached"]
    assert take.keyed.frame_start == -7.5 and take.keyed.first == -7
    seconds = (take.keyed.frame_end - take.keyed.frame_start) / take.keyed.fps
    assert seconds == pytest.approx((len(take.result.hips_position) - 1) / 30, abs=1.5 / take.keyed.fps)
    hips, _ = read_back(character, [-7.5])
    assert np.abs(hips[0] - take.result.hips_position[0]).max() < 1e-4


def test_what_a_take_cannot_begin_with_is_told(room):
    character, chair, _ = room
    with pytest.raises(GoalError, match="stand"):
        TakeSpec(character, [GoalSpec("sit", chair)], begin="fly")
    character.pose.bones["Hips"].rotation_mode = "XYZ"
    character.pose.bones["Hips"].rotation_euler = (1.5, 0.0, 0.0)
    bpy.context.view_layer.update()
    with pytest.raises(GoalError, match="get up"):
        make(character, "sit", chair, begin="pose")
