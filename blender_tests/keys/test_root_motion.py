"""What carries a take through the world changes nothing that is seen, but where it plays in place."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from motions import blender_heads, wandering_take
from scenes import empty

from nsm_blender.animation.channels import channels_of
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import key_take, key_take_steps
from nsm_blender.keys.style import KeyStyle
from nsm_blender.rigs.armature import build_armature
from nsm_blender.rigs.mount import last
from nsm_core.body.key_reduction import Bound
from nsm_core.body.skeleton import OFFSETS, forward_kinematics, root_of
from nsm_core.errors import NsmError

FRAMES = range(1, 41)
TILTED = Matrix.Translation((2, -1, 0.3)) @ Matrix.Rotation(0.8, 4, "Z") @ Matrix.Rotation(np.pi / 2, 4, "X")


def character(rooted: bool = False, lying: bool = False) -> bpy.types.Object:
    """The bundled armature, with a bone above its hips, or built with Y up and turned upright as importers
    do.
    """
    bpy.context.scene.render.fps = 30
    armature = build_armature("Character")
    if rooted:
        bpy.ops.object.mode_set(mode="EDIT")
        bones = armature.data.edit_bones
        root = bones.new("root")
        root.head, root.tail, root.roll = (0, 0, 0), (0, 0.4, 0.1), 0.3
        bones["Hips"].parent = root
        bpy.ops.object.mode_set(mode="OBJECT")
    if lying:
        armature.data.transform(Matrix.Rotation(-np.pi / 2, 4, "X"))
        armature.matrix_world = TILTED
    else:
        armature.matrix_world = Matrix.Translation((3, 1, 0)) @ Matrix.Rotation(1.0, 4, "Z")
    return armature


def expected(hips: np.ndarray, local: np.ndarray) -> np.ndarray:
    return forward_kinematics(hips, local, OFFSETS.astype(float))[0]


def keyed(armature: bpy.types.Object) -> set[str]:
    return {curve.data_path for curve in channels_of(armature).bag.fcurves}


@pytest.mark.parametrize("kind", ["hips", "object", "bone"])
@pytest.mark.parametrize("how", ["plain", "euler", "lying", "carried"])
def test_the_world_motion_is_the_same_whatever_carries_it(kind, how):
    armature = character(rooted=kind == "bone", lying=how == "lying")
    if how == "euler":
        armature.rotation_mode = "YXZ"
        armature.pose.bones[0].rotation_mode = "ZYX"
    else:
        armature.rotation_mode = "QUATERNION"
    if how == "carried":
        cart = empty("Cart", (0, 0, 0))
        armature.parent = cart
        for frame, x in ((1, 0.0), (40, 2.0)):
            cart.location.x, cart.rotation_euler.z = x, x
            cart.keyframe_insert("location", frame=frame)
            cart.keyframe_insert("rotation_euler", frame=frame)
    hips, local = wandering_take()
    key_take(armature, hips, local, style=KeyStyle(root_motion=kind))
    assert np.abs(blender_heads(armature, FRAMES) - expected(hips, local)).max() < 2e-4
    assert ("location" in keyed(armature)) == (kind == "object")
    assert ('pose.bones["root"].location' in keyed(armature)) == (kind == "bone")


@pytest.mark.parametrize("kind", ["object", "bone"])
def test_the_root_stays_on_the_floor_under_the_hips_and_faces_as_the_body_does(kind):
    armature = character(rooted=kind == "bone")
    hips, local = wandering_take()
    hips, local = (
        hips[:1].repeat(40, 0) + np.linspace(0, 3, 40)[:, None] * (0.6, 0.8, 0),
        local[:1].repeat(40, 0),
    )
    key_take(armature, hips, local, style=KeyStyle(root_motion=kind))
    _, heading = root_of(expected(hips, local))
    for frame in (1, 20, 40):
        bpy.context.scene.frame_set(frame)
        world, rest = armature.matrix_world, Matrix()
        if kind == "bone":
            world, rest = world @ armature.pose.bones["root"].matrix, armature.data.bones["root"].matrix_local
        assert np.allclose(world.translation, (*hips[frame - 1, :2], 0), atol=1e-4)
        assert np.allclose(
            (world @ rest.inverted()).to_3x3(), Matrix.Rotation(heading[frame - 1], 3, "Z"), atol=1e-4
        )


def test_in_place_only_the_way_is_missing():
    armature = character()
    hips, local = wandering_take()
    take = key_take(armature, hips, local, style=KeyStyle(root_motion="in_place"))
    seen = blender_heads(armature, FRAMES)
    assert np.abs(seen[:, 0, :2] - (3, 1)).max() < 0.2 and np.ptp(hips[:, 0]) > 1  # it sways about its place
    assert np.abs(seen[:, 0, 2] - hips[:, 2]).max() < 1e-4
    back = np.array([np.array(m.inverted()) for m in take.aside])
    there = np.einsum("nij,nkj->nki", back[:, :3, :3], seen) + back[:, None, :3, 3]
    assert np.abs(there - expected(hips, local)).max() < 2e-4


def test_a_discarded_take_leaves_the_object_where_it_was():
    armature = character()
    before = armature.matrix_world.copy()
    hips, local = wandering_take()
    take = key_take(armature, hips, local, style=KeyStyle(root_motion="object"))
    bpy.context.scene.frame_set(30)
    assert (armature.matrix_world.translation - before.translation).length > 0.5
    discard_take(take)
    assert np.allclose(armature.matrix_world, before, atol=1e-6) and not bpy.data.actions


@pytest.mark.parametrize("kind", ["hips", "object", "bone"])
def test_fewer_keys_keep_to_the_bound(kind):
    armature = character(rooted=kind == "bone")
    t = np.arange(120) / 30
    hips, local = wandering_take(120)
    hips = np.column_stack((t, np.zeros_like(t), 0.95 + 0.02 * np.sin(6 * t)))
    bound = Bound(8.0, 2.0)
    take = key_take(armature, hips, local, style=KeyStyle(root_motion=kind, reduce=bound))
    off = np.linalg.norm(blender_heads(armature, range(1, 121)) - expected(hips, local), axis=-1).max()
    assert 1000 * off <= 1.02 * bound.mm and abs(1000 * off - take.reduced.mm) < 0.1
    counts = {len(curve.keyframe_points) for curve in channels_of(armature).bag.fcurves}
    assert take.reduced.after < 0.75 * take.reduced.before and max(counts) < 120


def test_what_cannot_carry_a_root_is_refused_in_a_sentence():
    hips, local = wandering_take(3)
    armature = character()
    with pytest.raises(NsmError, match="no bone above its hips .* set Root Motion to Hips"):
        key_take(armature, hips, local, style=KeyStyle(root_motion="bone"))
    armature.constraints.new("CHILD_OF").target = empty("Cart", (0, 0, 0))
    with pytest.raises(NsmError, match=r"constraints .* set Root Motion to Hips"):
        key_take(armature, hips, local, style=KeyStyle(root_motion="object"))
    with pytest.raises(NsmError, match="no root motion 'feet'"):
        key_take(armature, hips, local, style=KeyStyle(root_motion="feet"))
    assert not bpy.data.actions


@pytest.mark.parametrize("kind", ["object", "bone"])
def test_a_take_that_goes_on_leaves_what_was_keyed_before_where_it_is_seen(kind):
    armature = character(rooted=kind == "bone")
    hips, local = wandering_take()
    key_take(armature, hips, local)
    before = blender_heads(armature, range(1, 20))
    style = KeyStyle(root_motion=kind, reduce=Bound())
    last(key_take_steps(armature, hips[19:], local[19:], 20, 30, "Further", None, True, style))
    assert np.abs(blender_heads(armature, range(1, 20)) - before).max() < 1e-4
    assert np.abs(blender_heads(armature, range(20, 41)) - expected(hips, local)[19:]).max() < 0.006
