"""Keying a take is all or nothing: whatever is raised at whatever line, the file is then exactly as
it was.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np
import pytest
from motions import wandering_take
from scenes import box, empty

import nsm_blender
from nsm_blender.animation.kept import Kept, restored_on_failure
from nsm_blender.keys.keying import key_take
from nsm_blender.keys.objects import MovedObject
from nsm_blender.rigs.armature import build_armature
from nsm_blender.takes import TakeSpec, finish, key_and_check
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.key_reduction import Bound
from nsm_core.control.goals import Goal, GoalResult
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Box
from nsm_core.world.sensors.interaction import interaction_sensor

CODE = str(Path(nsm_blender.__file__).parent)
FRAMES = 4
NOT_HERE = ("restore", "_try", "_set", "_bones", "finish")  # putting back, and handing over


def curves(action):
    bags = (
        (b for layer in action.layers for strip in layer.strips for b in strip.channelbags)
        if hasattr(action, "layers")
        else [action]
    )
    return tuple(
        sorted(
            (c.data_path, c.array_index, tuple(tuple(k.co) for k in c.keyframe_points))
            for b in bags
            for c in b.fcurves
        )
    )


def transform(moving):
    names = ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale")
    return tuple(tuple(getattr(moving, n)) for n in names)


def animation(target):
    data = target.animation_data
    if data is None:
        return None
    slot = getattr(data, "action_slot", None)
    tracks = tuple(
        (t.name, t.mute, t.is_solo, tuple((s.name, s.action.name, s.frame_start, s.mute) for s in t.strips))
        for t in data.nla_tracks
    )
    settings = (
        data.use_nla,
        data.action_blend_type,
        data.action_influence,
        data.action_extrapolation,
        getattr(data, "last_slot_identifier", ""),
    )
    return data.action and data.action.name, slot and slot.identifier, tracks, settings, len(data.drivers)


def digest():
    """All of a file that a take could touch, in values that can be compared."""
    scene = bpy.context.scene
    return {
        "counts": {
            name: len(getattr(bpy.data, name))
            for name in ("objects", "meshes", "actions", "armatures", "collections", "materials")
        },
        "actions": {
            a.name: (a.users, a.use_fake_user, a.is_library_indirect, curves(a)) for a in bpy.data.actions
        },
        "slots": {
            a.name: tuple((s.identifier, len(s.users())) for s in getattr(a, "slots", ()))
            for a in bpy.data.actions
        },
        "objects": {
            o.name: (transform(o), tuple(map(tuple, o.matrix_world)), animation(o)) for o in bpy.data.objects
        },
        "poses": {(o.name, b.name): transform(b) for o in bpy.data.objects if o.pose for b in o.pose.bones},
        "frame": (scene.frame_current, scene.frame_subframe, scene.frame_start, scene.frame_end),
        "selection": (
            tuple(o.name for o in bpy.context.selected_objects),
            bpy.context.view_layer.objects.active.name,
        ),
    }


def keyed_before(target, path="location"):
    for frame in (1, 30):
        setattr(target, path, (frame / 30, 0.2, 0.9))
        target.keyframe_insert(path, frame=frame)


@pytest.fixture(params=["bare", "animated", "again"])
def job(request):
    """A character and a box with or without a past, poses that nobody has keyed, and a motion that is to be
    keyed; "again": on the object and with fewer keys, over a take that the animator has edited.
    """
    scene = bpy.context.scene
    scene.render.fps = 30
    character, thing, other = (
        build_armature("Hero"),
        box("Box", (1, -1, 0), (1.3, -0.7, 0.3)),
        empty("Other", (3, 0, 0)),
    )
    if request.param == "animated":
        (
            keyed_before(character),
            keyed_before(character.pose.bones["Hips"]),
            keyed_before(thing),
            keyed_before(other),
        )
        character.animation_data.action.name, thing.animation_data.action.name = "Old", "Old of box"
        track = thing.animation_data.nla_tracks.new()
        track.strips.new("below", 1, thing.animation_data.action)
        character.parent = empty("Cart", (0, 0, 0))
        keyed_before(character.parent)
        thing.parent = character.parent
    if request.param == "again":
        key_take(character, *wandering_take(FRAMES, 4), 3, name="Old")
        character.pose.bones["Head"].rotation_quaternion = (0.8, 0.6, 0, 0)
        character.pose.bones["Head"].keyframe_insert("rotation_quaternion", frame=4)
    scene.frame_set(7, subframe=0.5)
    character.pose.bones["LeftElbow"].rotation_quaternion = (0.8, 0.6, 0, 0)
    character.pose.bones["Hips"].location = (0.1, 0.2, 0.3)
    thing.location.y += 0.25
    other.location.z += 0.5
    bpy.context.view_layer.update()
    frame = WorldFrame.of(character)
    solid = Cuboids([((0.0, 0.0), 0.0, np.full((1, 3), -0.15), np.full((1, 3), 0.15))])
    pose = np.append(frame.to_core(np.array(thing.matrix_world.translation)), 0.0)
    prop = Box(
        "Box", solid, interaction_sensor(solid, np.zeros(3), np.full(3, 0.3), 0.0), pose, size=np.full(3, 0.3)
    )
    hips, local = wandering_take(FRAMES)
    poses = pose + np.linspace(0, 1, FRAMES)[:, None] * (0.3, 0.1, 0.2, 0.5)
    zeros = np.zeros((FRAMES, 7), np.float32)
    result = TakeResult(
        hips,
        local,
        hips,
        local,
        zeros[:, :5],
        zeros[:, :3],
        zeros,
        zeros,
        [
            GoalResult(
                "Box", "carry", True, 0.2, 0.0, 0.0, end_frame=FRAMES - 1, place=poses[-1, :3], facing=0.5
            )
        ],
        {},
        {"Box": poses},
    )
    asked = TakeRequest(np.zeros(2), 0.0, [Goal("carry", "Box", poses[-1, :3], 0.5, prop=prop)], Cuboids())
    spec = TakeSpec(character, [], "New", 3)
    if request.param == "again":
        spec.root_motion, spec.reduce = "object", Bound()
    things = {"Box": MovedObject.of(thing, frame, prop)}
    return lambda: key_and_check(spec, scene, asked, result, frame, things), [character, thing]


class Injected(BaseException):
    """Raised where a test says, as a break of the animator's or a lack of memory is."""


def traced(steps, at=None):
    """Run steps and raise ``Injected`` at the line number ``at`` that the add-on comes to; else the distinct
    lines' first numbers.
    """
    seen, first = 0, {}

    def tracer(frame, event, _):
        nonlocal seen
        code = frame.f_code
        if not code.co_filename.startswith(CODE) or code.co_name in NOT_HERE:
            return None
        if event == "line":
            seen += 1
            first.setdefault((code.co_filename, frame.f_lineno), seen)
            if seen == at:
                sys.settrace(None)
                raise Injected
        return tracer

    sys.settrace(tracer)
    try:
        finish(steps)
    finally:
        sys.settrace(None)
    return sorted({*first.values(), seen})


def test_whatever_is_raised_at_whatever_line_nothing_is_left(job):
    steps, targets = job
    before = digest()
    with pytest.raises(Injected), restored_on_failure(Kept(bpy.context.scene, targets)):
        lines = traced(steps())
        assert {"New", "New Box"} == {a.name for a in bpy.data.actions} - set(before["actions"])
        raise Injected
    assert digest() == before
    assert len(lines) > 150
    tried, broken = (
        lines[:: 4 if "Old of box" in bpy.data.actions else 10],
        0,
    )  # every one holds; these few are quick
    for at in tried:
        kept = Kept(bpy.context.scene, targets)
        try:
            traced(steps(), at)
        except Injected:
            broken += 1
        else:  # how often one waits and looks depends on time, so that this run was over before that line
            with suppress(Injected), restored_on_failure(kept):
                raise Injected
        after = digest()
        assert after == before, (at, {k: (after[k], before[k]) for k in before if after[k] != before[k]})
    assert broken > 0.8 * len(tried)


def test_a_take_that_is_closed_while_it_is_looked_at_leaves_nothing(job):
    steps, _ = job
    before, running = digest(), steps()
    while next(running).stage != "Checking":
        pass
    next(running)
    assert "New" in bpy.data.actions
    running.close()
    assert digest() == before


def test_what_the_animator_makes_while_a_take_is_keyed_stays(job):
    steps, targets = job
    running, theirs = steps(), []
    for stage in ("Making keys", "Checking"):
        while next(running).stage != stage:
            pass
        theirs.append(bpy.data.actions.new("New"))
        theirs.append(targets[0].animation_data.action.copy())
    made = targets[0].animation_data.action.name
    names = [action.name for action in theirs]
    running.close()
    assert made not in bpy.data.actions
    assert all(bpy.data.actions[name] == action for name, action in zip(names, theirs, strict=True))


def test_a_whole_take_leaves_what_was_moved_without_a_key(job):
    steps, _ = job
    other = bpy.data.objects["Other"]
    frame, place = bpy.context.scene.frame_current, tuple(other.location)
    take = finish(steps())
    assert (
        take.report["shown_off_cm"] < 0.1
        and not take.report["warnings"]
        and take.report["goals"][0]["reached"]
    )
    assert bpy.context.scene.frame_current == frame and tuple(other.location) == place
