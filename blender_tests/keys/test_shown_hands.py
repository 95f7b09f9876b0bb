"""A report tells how far hands are from what they take on the bones and objects that are seen, not in the
motion that was made.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Vector
from motions import wandering_take
from scenes import box

from nsm_blender.keys.objects import MovedObject
from nsm_blender.rigs.armature import build_armature
from nsm_blender.takes import TakeSpec, finish, key_and_check
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.skeleton import ARMS, forward_kinematics
from nsm_core.control.goals import Goal, GoalResult, Taken
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Box
from nsm_core.world.sensors.interaction import interaction_sensor

FRAMES, GRASP = 30, 13
_WRISTS = [arm[2] for arm in ARMS]


def taking(hero, hands):
    """Key a motion whose hands are exactly where they should be on a box that turns; the report's line about
    it.
    """
    scene = bpy.context.scene
    scene.render.fps = 30
    crate = box("Box", (1, -1, 0), (1.3, -0.7, 0.3))
    frame = WorldFrame.of(hero)
    solid = Cuboids([((0.0, 0.0), 0.0, np.full((1, 3), -0.15), np.full((1, 3), 0.15))])
    pose = np.append(frame.to_core(np.array(crate.bound_box).mean(0)), 0.0)
    prop = Box(
        "Box", solid, interaction_sensor(solid, np.zeros(3), np.full(3, 0.3), 0.0), pose, size=np.full(3, 0.3)
    )
    hips, local = wandering_take(FRAMES)
    poses = pose + np.linspace(0, 1, FRAMES)[:, None] * (0.3, 0.1, 0.2, 0.5)
    wrists = forward_kinematics(hips[GRASP], local[GRASP])[0][_WRISTS]
    taken = Taken(hands, prop.to_local(wrists[hands], poses[GRASP]), GRASP)
    assert taken.errors(wrists, poses[GRASP])[0] == pytest.approx(0, abs=1e-9)
    zeros = np.zeros((FRAMES, 7), np.float32)
    goal = GoalResult(
        "Box",
        "carry",
        True,
        1.0,
        0.0,
        0.0,
        end_frame=FRAMES - 1,
        place=poses[-1, :3],
        facing=0.5,
        hand_error_cm=0.0,
    )
    goal.taken, goal.hand_rotation_deg = taken, 0.0 if len(hands) == 2 else np.nan
    result = TakeResult(
        hips, local, hips, local, zeros[:, :5], zeros[:, :3], zeros, zeros, [goal], {}, {"Box": poses}
    )
    asked = TakeRequest(np.zeros(2), 0.0, [Goal("carry", "Box", poses[-1, :3], 0.5, prop=prop)], Cuboids())
    things = {"Box": MovedObject.of(crate, frame, prop)}
    return finish(key_and_check(TakeSpec(hero, [], "New", 3), scene, asked, result, frame, things)).report


@pytest.mark.parametrize("hands", [[0, 1], [1]])
def test_hands_of_the_network_s_own_skeleton_are_where_they_were_made(hands):
    report = taking(build_armature("Hero"), hands)
    assert report["goals"][0]["hand_error_cm"] < 0.05
    turn = report["goals"][0]["hand_rotation_deg"]
    assert turn is None if hands == [1] else turn < 0.05


def test_longer_arms_are_told():
    hero = build_armature("Hero")
    bpy.ops.object.mode_set(mode="EDIT")
    for side in ("Left", "Right"):
        forearm, hand = (hero.data.edit_bones[side + name] for name in ("Elbow", "Wrist"))
        longer = Vector(forearm.vector).normalized() * 0.06
        forearm.tail += longer
        hand.head += longer
        hand.tail += longer
    bpy.ops.object.mode_set(mode="OBJECT")
    report = taking(hero, [0, 1])
    assert report["goals"][0]["hand_error_cm"] == pytest.approx(6, abs=0.2) and report["shown_off_cm"] < 0.1
    assert report["frames_looked_at"] >= 3


def test_a_box_that_something_else_moves_is_told():
    bpy.app.handlers.frame_change_pre.append(lift)
    try:
        report = taking(build_armature("Hero"), [0, 1])
    finally:
        bpy.app.handlers.frame_change_pre.remove(lift)
    assert report["goals"][0]["hand_error_cm"] == pytest.approx(20, abs=0.5) and report["warnings"]


def lift(scene, *_):
    """What a rig's script may do after keys are made."""
    scene.objects["Box"].delta_location.z = 0.2
