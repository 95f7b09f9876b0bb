"""The list of takes: takes beside each other, shown in turn, pushed to the NLA and back, cleared; nothing of
the animator's is lost on the way.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest

import nsm_blender
from nsm_blender.keys import strips
from nsm_blender.keys.keying import key_take, key_things
from nsm_blender.keys.objects import MovedObject
from nsm_blender.rigs.armature import build_armature
from nsm_blender.rigs.mount import last
from nsm_blender.ui import reviews
from nsm_blender.ui.reviews import pending, remember
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.skeleton import J
from nsm_core.errors import NsmError


@pytest.fixture
def scene():
    """A scene with a character that has an action of the animator's own, and a box."""
    nsm_blender.register()
    scene = bpy.context.scene
    scene.render.fps = 30
    character = build_armature("Character")
    scene.nsm.character = character
    for frame, x in ((1, 0.0), (50, 1.0)):
        character.pose.bones["Hips"].location.x = x
        character.pose.bones["Hips"].keyframe_insert("location", frame=frame)
    character.animation_data.action.name = "Mine"
    box = bpy.data.objects.new("Box", bpy.data.meshes.new("Box"))
    scene.collection.objects.link(box)
    box.location.x = 5
    scene.frame_set(1)
    yield scene
    nsm_blender.unregister()


class _Prop:
    name, pose = "Box", np.array((5.0, 0, 0, 0))


def generate(
    name: str, way: float = 1.0, start: int = 1, beside: bool = False, box: float = 0.0, seed: int = 0
):
    """What Generate does once a motion is there: walk ``way`` metres along X, and push the box by ``box``."""
    scene = bpy.context.scene
    character, frames = scene.nsm.character, 20
    rotations = np.zeros((frames, J, 4))
    rotations[..., 0] = 1
    hips = np.column_stack((np.linspace(0, way, frames), np.zeros(frames), np.full(frames, 0.97)))
    take = key_take(character, hips, rotations, start, 30, name, scene)
    if box:
        thing = MovedObject.of(bpy.data.objects["Box"], WorldFrame(), _Prop)
        poses = _Prop.pose + np.linspace(0, box, frames)[:, None] * (1, 0, 0, 0)
        last(key_things(take, [(thing, poses)], 30, name, scene))
    return remember(scene, take, seed, beside)


def at(frame: int) -> tuple[float, float]:
    """Where the hips and the box are seen at a frame, along X."""
    bpy.context.scene.frame_set(frame)
    character = bpy.data.objects["Character"]
    hips = character.matrix_world @ character.pose.bones["Hips"].head
    return round(hips.x, 3), round(bpy.data.objects["Box"].matrix_world.translation.x, 3)


def current() -> str | None:
    action = bpy.context.scene.nsm.character.animation_data.action
    return action and action.name


def names() -> list[str]:
    return [take.character.action.name for take in bpy.context.scene.nsm.takes]


def test_another_take_stays_beside_the_one_before_and_each_can_be_shown(scene):
    generate("One", 1.0)
    generate("Two", 2.0, beside=True, box=1.0, seed=1)
    assert names() == ["One", "Two"] and [t.seed for t in scene.nsm.takes] == [0, 1]
    assert at(20) == (2.0, 6.0)
    assert bpy.ops.nsm.take_show(index=0) == {"FINISHED"} and current() == "One" and at(20) == (1.0, 5.0)
    assert bpy.ops.nsm.take_show(index=1) == {"FINISHED"} and current() == "Two" and at(20) == (2.0, 6.0)
    assert bpy.ops.nsm.take_reject() == {"FINISHED"}
    assert (current(), names(), at(50)) == ("Mine", ["One"], (-1.0, 5.0))
    bpy.ops.nsm.take_show(index=0)
    assert bpy.ops.nsm.take_reject() == {"FINISHED"}
    assert (current(), names(), at(50)) == ("Mine", [], (-1.0, 5.0))
    assert {a.name: a.use_fake_user for a in bpy.data.actions} == {"Mine": False}


def test_the_list_is_saved_with_all_its_takes(scene, tmp_path):
    generate("One", 1.0)
    generate("Two", 2.0, beside=True)
    for _ in range(2):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert names() == ["One", "Two"] and pending(bpy.context.scene) is not None
    bpy.ops.nsm.take_show(index=0)
    assert at(20)[0] == 1.0 and bpy.ops.nsm.take_accept() == {"FINISHED"}
    assert pending(bpy.context.scene) is None and [t.accepted for t in bpy.context.scene.nsm.takes] == [1, 0]
    assert bpy.ops.nsm.takes_clear() == {"FINISHED"} and names() == ["One"] and current() == "One"


def test_clearing_leaves_accepted_takes_and_gives_back_what_was_before_a_shown_one(scene):
    for number in range(4):
        generate(f"Take {number}", beside=True, box=1.0 + number)
    bpy.ops.nsm.take_keep(index=1)
    assert bpy.ops.nsm.takes_clear() == {"FINISHED"}
    assert names() == ["Take 1"] and current() == "Mine" and at(50) == (-1.0, 5.0)
    assert not bpy.ops.nsm.takes_clear.poll()
    bpy.ops.nsm.take_remove(index=0)
    assert {a.name: a.use_fake_user for a in bpy.data.actions} == {"Mine": False}


def test_a_take_pushed_to_the_nla_plays_as_before_and_comes_back(scene):
    generate("Take", 2.0, start=5, box=1.0)
    before = [at(frame) for frame in range(0, 40)]
    assert (
        bpy.ops.nsm.take_push() == {"FINISHED"} and current() is None and not bpy.ops.nsm.take_accept.poll()
    )
    strip = scene.nsm.character.animation_data.nla_tracks["NSM"].strips[0]
    assert (strip.frame_start, strip.frame_end, strip.blend_type) == (5, 24, "REPLACE")
    assert [at(frame) for frame in range(0, 40)] == before
    assert bpy.ops.nsm.take_pull() == {"FINISHED"} and current() == "Take"
    assert [at(frame) for frame in range(0, 40)] == before
    assert not len(scene.nsm.character.animation_data.nla_tracks)
    bpy.ops.nsm.take_push()
    assert bpy.ops.nsm.take_remove() == {"FINISHED"} and current() == "Mine" and at(50) == (-1.0, 5.0)
    assert {a.name: a.use_fake_user for a in bpy.data.actions} == {"Mine": False}


def test_what_lies_below_a_strip_plays_before_and_after_it(scene):
    data = scene.nsm.character.animation_data
    data.nla_tracks.new().strips.new("Mine", 1, bpy.data.actions["Mine"])
    data.action = None
    below = [at(frame) for frame in (5, 45)]
    generate("Take", 2.0, start=10)
    bpy.ops.nsm.take_push()
    assert [at(frame) for frame in (5, 45)] == below and at(29)[0] == 2.0
    generate("Further", 3.0, start=40)
    bpy.ops.nsm.take_push()
    tracks = data.nla_tracks
    assert [t.name for t in tracks] == ["NlaTrack", "NSM"] and len(tracks["NSM"].strips) == 2
    assert (at(59)[0], at(29)[0], at(5)) == (3.0, 2.0, below[0])


def test_pushing_one_of_two_things_that_fails_changes_nothing(scene, monkeypatch):
    generate("Take", 2.0, box=1.0)
    push, done = strips.push, []

    def broken(target, *rest):
        if done:
            raise NsmError("No.")
        done.append(push(target, *rest))

    monkeypatch.setattr(strips, "push", broken)
    with pytest.raises(NsmError):
        reviews.push(scene, scene.nsm.takes[0])
    assert current() == "Take" and at(20) == (2.0, 6.0) and pending(scene) is not None
    assert not len(scene.nsm.character.animation_data.nla_tracks)


def test_an_action_made_by_hand_since_is_kept_and_given_back(scene):
    generate("Take")
    character = scene.nsm.character
    character.animation_data.action = None
    character.pose.bones["Hips"].location.x = 7
    character.pose.bones["Hips"].keyframe_insert("location", frame=1)
    character.animation_data.action.name = "By hand"
    bpy.ops.nsm.take_show(index=0)
    assert current() == "Take" and bpy.data.actions["By hand"].use_fake_user
    bpy.ops.nsm.take_reject()
    assert current() == "By hand" and at(1)[0] == -7.0 and not bpy.data.actions["By hand"].use_fake_user


def test_the_scene_gets_the_range_of_a_take(scene):
    generate("Take", start=300)
    bpy.ops.nsm.take_range()
    assert (scene.frame_start, scene.frame_end) == (300, 319)
    scene.use_preview_range = True
    generate("Early", start=-30)
    bpy.ops.nsm.take_range()
    assert (scene.frame_preview_start, scene.frame_preview_end, scene.frame_start) == (-30, -11, 300)
