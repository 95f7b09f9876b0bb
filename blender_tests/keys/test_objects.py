"""Objects that a take moves: their keys against the poses of their props, and the scene afterwards."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scenes import door, empty, mesh_of_boxes

import nsm_blender
from nsm_blender.animation.channels import channels_of
from nsm_blender.animation.kept import SceneState
from nsm_blender.goals.open import read_leaf
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import key_take, key_things
from nsm_blender.keys.objects import MovedObject, moving_rows, resample_poses
from nsm_blender.keys.preview import Preview
from nsm_blender.rigs.armature import build_armature
from nsm_blender.rigs.mount import last
from nsm_blender.ui.operators import review
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.surroundings import Surroundings
from nsm_core.body.skeleton import J
from nsm_core.errors import NsmError
from nsm_core.rotations import rotate_planar
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Prop

FRAMES = 41  # at 30 Hz


def crate(location=(1.0, 0.5, 0.2), turn=0.3, name="Box"):
    return mesh_of_boxes(name, [((-0.2, -0.15, 0), (0.2, 0.15, 0.25))], location, turn)


def carried(first, frames=FRAMES):
    """Poses (T, 4): still, then carried along an arc that passes half a turn, then still."""
    t = np.clip((np.arange(frames) - 10) / (frames - 21), 0, 1)[:, None]
    turn = first[3] + 4.0 * t[:, 0]
    path = np.column_stack((1.5 * np.sin(3 * t[:, 0]), 2 * t[:, 0], 0.6 * np.sin(np.pi * t[:, 0])))
    poses = np.column_stack((first[:3] + path, turn))
    poses[:, 3] = (poses[:, 3] + np.pi) % (2 * np.pi) - np.pi  # headings as they come from the core
    return poses


def thing_of(target, frame=None):
    bpy.context.view_layer.update()
    frame = frame or WorldFrame()
    place = frame.to_core(np.array(target.matrix_world.translation))
    # Its frame is not the object's own.
    prop = Prop(target.name, Cuboids(), None, np.append(place + (0.1, -0.2, 0.05), 0.4))
    return MovedObject.of(target, frame, prop)


def standing_take(frames=FRAMES, start=5):
    armature = bpy.data.objects.get("Character") or build_armature("Character")
    local = np.zeros((frames, J, 4))
    local[..., 0] = 1
    return key_take(armature, np.tile((0, 0, 0.97), (frames, 1)), local, start)


def key(thing, poses, start=5):
    bpy.context.scene.render.fps = 30
    take = standing_take(len(poses), start)
    last(key_things(take, [(thing, poses)], 30, "Carry", bpy.context.scene))
    return take


def world_at(target, frame):
    bpy.context.scene.frame_set(frame)
    return np.array(target.matrix_world)


def expected(pose, first, world):
    """World matrix after the rigid move that brings the prop from ``first`` to ``pose``."""

    def matrix(p):
        return np.array(Matrix.Translation(p[:3]) @ Matrix.Rotation(p[3], 4, "Z"))

    return matrix(pose) @ np.linalg.inv(matrix(first)) @ world


def assert_follows(target, thing, poses, start=5, frame=None):
    frame, world = frame or WorldFrame(), np.array(thing.world)
    placed = [np.append(frame.to_world(p[:3]), p[3]) for p in poses]
    first = np.append(frame.to_world(thing.pose[:3]), thing.pose[3])
    for k in range(0, len(poses), 4):
        np.testing.assert_allclose(world_at(target, start + k), expected(placed[k], first, world), atol=2e-4)


def mode(name):
    def change(target):
        target.rotation_mode = name

    return change


def parented(target):
    holder = empty("Holder", (0.4, -1.0, 0.3), 0.8)
    holder.scale = (1.5, 1.5, 1.5)
    target.parent = holder


def parented_keeping_its_place(target):
    holder = empty("Holder", (0.4, -1.0, 0.3), 0.8)
    holder.rotation_euler.x = 0.5
    bpy.context.view_layer.update()
    target.parent, target.matrix_parent_inverse = holder, holder.matrix_world.inverted()


def on_a_moving_holder(target):
    parented_keeping_its_place(target)
    holder = target.parent
    for frame, x in ((1, 0.4), (60, 3.0)):
        holder.location.x = x
        holder.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(5)


def shifted(target):
    target.delta_location, target.delta_rotation_euler = (0.2, 0.1, 0.0), (0.0, 0.0, 0.7)


def mirrored(target):
    target.scale = (-1.0, 1.0, 2.0)


def tilted(target):
    target.rotation_euler = (0.4, -0.3, 1.0)


CASES = {
    f.__name__: f
    for f in (parented, parented_keeping_its_place, on_a_moving_holder, shifted, mirrored, tilted)
}
CASES |= {name: mode(name) for name in ("XYZ", "ZYX", "QUATERNION", "AXIS_ANGLE")}


@pytest.mark.parametrize("case", CASES)
def test_an_object_follows_its_prop_wherever_it_hangs(case):
    target = crate()
    CASES[case](target)
    thing = thing_of(target)
    poses = carried(thing.pose)
    key(thing, poses)
    assert_follows(target, thing, poses)


def test_a_scaled_character_moves_things_in_its_own_units():
    target, frame = crate((1.0, 0.5, 0.7)), WorldFrame(scale=0.5, floor=0.5)
    thing = thing_of(target, frame)
    poses = carried(thing.pose)
    key(thing, poses)
    assert_follows(target, thing, poses, frame=frame)


def test_a_leaf_turns_about_its_hinge_and_its_parts_go_along():
    target = door((1.0, 0.0, 0.0))
    knob = mesh_of_boxes("Knob", [((-0.02, -0.1, -0.02), (0.02, 0.1, 0.02))], (1.75, 0.0, 1.0))
    knob.parent, knob.matrix_parent_inverse = target, target.matrix_world.inverted()
    leaf = read_leaf(target, None, None, Surroundings(bpy.context.scene, WorldFrame(), moving=[target]))
    angles = np.clip(np.linspace(-0.2, 1.6, FRAMES), 0, 1.5)
    take = key(MovedObject.of(target, WorldFrame(), leaf), np.array([leaf.pose_at(a) for a in angles]))
    assert [t.object for t in take.things] == [target]
    open_by = world_at(target, 5 + FRAMES - 1)
    np.testing.assert_allclose(open_by[:3, 3], (1, 0, 0), atol=1e-5)
    assert math.atan2(open_by[1, 0], open_by[0, 0]) == pytest.approx(1.5 * leaf.swing, abs=1e-4)
    np.testing.assert_allclose(
        knob.matrix_world.translation[:2],
        (1, 0) + rotate_planar(np.array((0.75, 0)), 1.5 * leaf.swing),
        atol=1e-4,
    )


@pytest.mark.parametrize(("fps", "base"), [(24, 1.0), (60, 1.0), (30, 1.001)])
def test_the_scene_rate_is_honoured(fps, base):
    target, scene = crate(), bpy.context.scene
    scene.render.fps, scene.render.fps_base = fps, base
    thing = thing_of(target)
    poses = carried(thing.pose)
    take = standing_take()
    last(key_things(take, [(thing, poses)], 30, "Carry", scene))
    np.testing.assert_allclose(
        world_at(target, take.frame_end), expected(poses[-1], thing.pose, np.array(thing.world)), atol=1e-4
    )
    half = round(20 / 30 * fps / base)
    at = half * base / fps * 30
    poses[:, 3] = np.unwrap(poses[:, 3])
    between = poses[int(at)] + (at - int(at)) * (poses[int(at) + 1] - poses[int(at)])
    np.testing.assert_allclose(
        world_at(target, 5 + half), expected(between, thing.pose, np.array(thing.world)), atol=1e-3
    )


def test_keys_lie_where_it_moves_and_at_both_ends():
    target = crate()
    thing = thing_of(target)
    take = key(thing, carried(thing.pose))
    bag = channels_of(target).bag
    assert {(f.data_path, f.array_index) for f in bag.fcurves} == {
        (p, i) for p in ("location", "rotation_euler") for i in range(3)
    }
    frames = [round(k.co.x) for k in bag.fcurves[0].keyframe_points]
    assert frames[0] == 5 and frames[-1] == 5 + FRAMES - 1
    assert frames[1:-1] == list(range(5 + 10, 5 + FRAMES - 10))
    made = take.things[0].action
    assert made.name == "Carry Box" and made == target.animation_data.action != take.action
    if hasattr(made, "slots"):
        assert target.animation_data.action_slot.identifier == "OBBox"


def test_what_does_not_move_is_not_keyed():
    target = crate()
    thing = thing_of(target)
    take = key(thing, np.tile(thing.pose, (FRAMES, 1)))
    assert not take.things and target.animation_data is None
    assert not len(moving_rows(np.zeros((5, 4)))) and not len(moving_rows(np.zeros((1, 4))))


def test_headings_are_resampled_by_the_shorter_way():
    poses = np.zeros((3, 4))
    poses[:, 3] = (3.0, -3.1, -2.9)
    resampled = resample_poses(poses, 30, 60)
    assert len(resampled) == 5 and np.abs(np.diff(resampled[:, 3])).max() < 0.15
    np.testing.assert_allclose(resample_poses(poses, 30, 30)[:, 3], np.unwrap(poses[:, 3]))


def old_action(target):
    for frame, x in ((1, 1.0), (60, 2.0)):
        target.location.x = x
        target.keyframe_insert("location", frame=frame)
        target.keyframe_insert("scale", frame=frame)
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)
    return target.animation_data.action


def test_the_old_action_is_kept_and_comes_back_with_the_take_discarded():
    target = crate()
    old = old_action(target)
    thing = thing_of(target)
    before = [world_at(target, f) for f in (1, 30, 60)]
    bpy.context.scene.frame_set(5)
    take = key(thing, carried(thing.pose))
    assert take.things[0].previous_action == old and old.use_fake_user
    discard_take(take)
    assert target.animation_data.action == old and not old.use_fake_user
    assert [a.name for a in bpy.data.actions] == [old.name]
    for frame, there in zip((1, 30, 60), before, strict=True):
        np.testing.assert_allclose(world_at(target, frame), there, atol=1e-6)


def test_an_unanimated_object_goes_back_to_its_place():
    target = crate()
    place = np.array(target.matrix_world)
    thing = thing_of(target)
    take = key(thing, carried(thing.pose))
    bpy.context.scene.frame_set(30)
    discard_take(take)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(np.array(target.matrix_world), place, atol=1e-6)
    assert target.animation_data.action is None and not bpy.data.actions


def test_where_one_thing_cannot_be_keyed_nothing_is():
    good, bad = crate(name="Good"), crate(name="Bad")
    things = [thing_of(good), thing_of(bad)]
    poses = carried(things[0].pose)
    broken = carried(things[1].pose)
    broken[7, 2] = np.nan
    take = standing_take()
    with pytest.raises(NsmError, match="places of Bad that are not numbers"):
        last(key_things(take, [(things[0], poses), (things[1], broken)], 30, "Carry", bpy.context.scene))
    assert not bpy.data.actions and take.armature.animation_data.action is None


def test_preview_moves_objects_and_escape_puts_them_back():
    character, target = build_armature("Character"), crate()
    target.rotation_mode = "QUATERNION"
    target.rotation_quaternion = (2.0, 0.0, 0.0, 1.0)  # not normalised: must come back as it was
    parented(target)
    thing = thing_of(target)
    before = tuple(target.location), tuple(target.rotation_quaternion), tuple(target.scale)
    state = SceneState(bpy.context.scene, character, [target])
    pose = thing.pose + (0.5, 0.2, 0.4, 1.0)
    rotations = np.zeros((J, 4))
    rotations[:, 0] = 1
    Preview(character).show((0, 0, 0.97), rotations, [(target, thing.world_at(pose))])
    bpy.context.view_layer.update()
    np.testing.assert_allclose(
        np.array(target.matrix_world), expected(pose, thing.pose, np.array(thing.world)), atol=1e-4
    )
    state.restore()
    assert (tuple(target.location), tuple(target.rotation_quaternion), tuple(target.scale)) == before


class TestReview:
    def test_reject_gives_everything_back_and_accept_keeps_it(self):
        nsm_blender.register()
        try:
            scene, target = bpy.context.scene, crate()
            old, thing = old_action(target), thing_of(target)
            review.remember(scene, key(thing, carried(thing.pose)))
            assert bpy.ops.nsm.take_reject() == {"FINISHED"}
            assert target.animation_data.action == old and [a.name for a in bpy.data.actions] == [old.name]
            review.remember(scene, key(thing, carried(thing.pose)))
            assert bpy.ops.nsm.take_accept() == {"FINISHED"}
            assert target.animation_data.action.name == "Carry Box" and old.name in bpy.data.actions
            review.remember(scene, key(thing, carried(thing.pose)))
            bpy.data.objects.remove(target)  # gone before the rejection
            assert bpy.ops.nsm.take_reject() == {"FINISHED"}
        finally:
            nsm_blender.unregister()


def test_one_undo_takes_keys_and_places_back():
    target = crate()
    standing_take()
    place, thing = np.array(target.matrix_world), thing_of(target)
    bpy.ops.ed.undo_push(message="before")
    key(thing, carried(thing.pose))
    bpy.context.scene.frame_set(30)
    bpy.ops.ed.undo_push(message="Generate")
    if bpy.ops.ed.undo() != {"FINISHED"}:
        pytest.skip("this build keeps no undo steps without a window")
    target = bpy.data.objects["Box"]
    assert (target.animation_data.action if target.animation_data else None) is None
    np.testing.assert_allclose(np.array(target.matrix_world), place, atol=1e-6)
