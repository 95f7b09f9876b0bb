"""Takes that begin from any pose: what leads to their quiet stand is filled in."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from everything import difference, digest
from test_fill_gap import joints

import nsm_blender
from nsm_blender.fill import lead
from nsm_blender.fill.spec import FillSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.ui.properties import queue_of
from nsm_blender.ui.reviews import pending

START = 20


@pytest.fixture(autouse=True)
def by_interpolation(monkeypatch):
    """What fills is not what is looked at here."""
    nsm_blender.register()
    monkeypatch.setattr(lead, "FillSpec", lambda *a, **k: FillSpec(*a, **k, method="interpolate"))
    yield
    nsm_blender.unregister()


@pytest.fixture
def lying():
    """A character that is keyed to lie down, and is to walk."""
    hero = add_character((0.0, 0.0, 0.0))
    hips, arm = hero.pose.bones["Hips"], hero.pose.bones["LeftElbow"]
    hips.rotation_mode = "XYZ"
    for frame, turn in ((1, 0.0), (START, 1.4)):
        hips.rotation_euler = (turn, 0.0, 0.0)
        hips.location = (0.0, 0.0, 0.0) if turn == 0 else (0.0, -0.6, 0.0)
        arm.rotation_quaternion = (1.0, turn / 2, 0.0, 0.0)
        hips.keyframe_insert("rotation_euler", frame=frame)
        hips.keyframe_insert("location", frame=frame)
        arm.keyframe_insert("rotation_quaternion", frame=frame)
    scene = bpy.context.scene
    scene.render.fps = 24
    scene.nsm.character, scene.nsm.begin, scene.nsm.start_frame = hero, "FILL", START
    row = queue_of(scene).goals.add()
    row.action, row.location, row.hold = "walk", (0.0, -1.5, 0.0), 0.0
    scene.frame_set(1)
    return hero


def test_who_lies_is_led_to_the_stand_that_its_take_begins_with(lying):
    scene, old = bpy.context.scene, lying.animation_data.action
    before, shown = digest(), joints(lying, range(1, START + 1))
    assert bpy.ops.nsm.generate() == {"FINISHED"}
    now = lying.animation_data.action
    record = pending(scene)
    assert record.character.action == now and record.frame_start == START + 24
    assert [a for a in bpy.data.actions if a not in (old, now)] == []
    assert np.abs(joints(lying, range(1, START + 1)) - shown).max() < 1e-4
    way = joints(lying, range(START, START + 40))
    assert np.linalg.norm(np.diff(way, axis=0), axis=-1).max() < 0.25
    assert way[24, 0, 2] > 0.8 > way[0, 0, 2]
    # Another one is another try of it, and has none of the fill's keys for the animator's.
    assert bpy.ops.nsm.another_take() == {"FINISHED"}
    assert not any("were kept" in line.text for line in scene.nsm.results)
    assert np.abs(joints(lying, range(1, START + 1)) - shown).max() < 1e-4
    bpy.ops.nsm.take_reject()
    bpy.ops.nsm.take_remove(index=0)
    scene.frame_set(1)
    scene.nsm.seed = 0
    lines = [line for line in difference(before, digest()) if "use_fake_user" not in line]
    assert not lines


def test_one_that_is_broken_off_leaves_nothing(lying):
    from nsm_blender.takes import generate
    from nsm_blender.ui.operators.generate import spec_of

    before = digest()
    steps = generate(spec_of(bpy.context.scene), bpy.context.scene)
    stages = []
    while (stage := next(steps).stage) != "Filling":
        stages.append(stage)
    assert "Making keys" in stages
    steps.close()
    assert not difference(before, digest())
